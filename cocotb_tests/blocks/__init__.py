"""Co-simulations of blocks: bench, test inside the simulator, and caller."""
