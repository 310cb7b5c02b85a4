"""Optimal control of many tasks at once: iLQR."""
