"""Looking back at what was computed."""
