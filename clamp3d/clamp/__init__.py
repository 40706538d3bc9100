"""The product as data: dimensions, parts, conductors, built-in clamp files."""
