"""Run the flow behind the RTL: netlists, gate simulation, timing, power, layout, datasheets, tapeout."""
