"""Layout of a readout in SkyWater 130 nm: verified cells, netlist, GDS and DEF."""
