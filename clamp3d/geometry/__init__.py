"""Pure numbers: poses, arcs and circles, rectangles, swept arcs and cylinders. No mesh, no file."""
