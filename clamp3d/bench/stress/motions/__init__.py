"""Families of hard motions: a wire that moves past a groove, and the least distance on its way."""
