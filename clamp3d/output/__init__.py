"""Reports, drawings, files and pictures."""
