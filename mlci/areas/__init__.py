"""Belief over areas: what is forbidden as one or two of many shapes, and what area to name."""
