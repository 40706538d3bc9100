"""Faulty meshes of a block with a groove, and good ones that are hard to read."""
