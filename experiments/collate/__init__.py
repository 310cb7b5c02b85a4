"""A study's tables, from those of its points."""
