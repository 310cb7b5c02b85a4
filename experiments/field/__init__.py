"""A benchmark of the field: methods that infer constraints, where these are known."""
