"""Finite worlds from arrays, and the distributions of trajectories and policies in them."""
