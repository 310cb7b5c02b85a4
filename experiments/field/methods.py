"""The methods of the benchmark: ours, the paper's as printed, and those of others."""

from experiments.field import others, ours

METHODS = {**ours.METHODS, **others.METHODS}
