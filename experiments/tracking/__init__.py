"""What is kept on disk, and where it came from; knows no science."""
