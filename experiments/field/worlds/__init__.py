"""The worlds of the benchmark, each written anew from its published description."""
