"""Hypotheses about controls: what somebody may be unable, or unwilling, to apply."""
