"""States from which a truth can be avoided, and a filter that keeps demonstrators in them."""
