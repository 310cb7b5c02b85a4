"""One point of a study: infer, measure, tables."""
