"""Other methods for the same question, and the common form in which all of them are asked."""
