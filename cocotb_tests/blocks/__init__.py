"""The co-simulation of a block: its bench, what runs in the simulator, and what plays it from outside."""
