"""The distribution of one task without cells: weighted paths round locally optimal ways."""
