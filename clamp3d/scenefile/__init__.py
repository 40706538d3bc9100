"""Descriptions of scenes in files: TOML in, a validated `Scene` out."""
