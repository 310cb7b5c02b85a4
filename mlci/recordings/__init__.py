"""Reading recorded demonstrations, and writing them."""
