"""Many points: planned, run in workers, on this machine or others."""
