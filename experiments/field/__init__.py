"""A benchmark of the field: methods that infer constraints, in worlds whose constraints are known."""
