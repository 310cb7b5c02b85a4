"""What a region can be: boxes, balls, half-spaces, predicates, and what is made of them."""
