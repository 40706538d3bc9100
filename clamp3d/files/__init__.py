"""Geometry from files: meshes, and the boundary representation (STEP) of CAD."""
