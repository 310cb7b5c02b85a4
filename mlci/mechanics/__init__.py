"""Linked rigid bodies: their motion, where they reach, and sound ways to keep them out."""
