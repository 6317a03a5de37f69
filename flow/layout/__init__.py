"""From the RTL to a layout in SkyWater 130 nm rules: cells checked against their transistors, netlist, GDS and DEF."""
