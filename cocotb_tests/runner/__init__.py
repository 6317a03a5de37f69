"""Build simulators, run jobs in them, and follow their progress from outside."""
