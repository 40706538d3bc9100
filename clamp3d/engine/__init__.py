"""Assemblies of any parts: which pairs clash, touch or keep their clearance, with no more model than that needs."""
