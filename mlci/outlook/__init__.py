"""How likely inference is to work in a discretisation, before anybody demonstrates anything."""
