"""Power of a netlist from what its nets do."""
