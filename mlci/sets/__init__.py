"""Several constraints: belief over sets of hypotheses, and selection of one set."""
