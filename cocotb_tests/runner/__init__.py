"""Build simulation programs, run jobs in them, and follow their progress."""
