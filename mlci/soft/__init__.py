"""Soft constraints: a cost per time inside a region, and how large it is."""
