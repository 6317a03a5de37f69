"""Power of a netlist from the simulated activity of its nets."""
