"""Cells of any kind: of varying size, and transitions that share a move among several cells."""
