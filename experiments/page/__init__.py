"""One result as one HTML page that needs nothing else: the answer, a map to click, and doubts."""
