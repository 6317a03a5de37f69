"""Flow from RTL to chip: netlists, gate-level simulation, timing, power, layout, datasheets, tapeout."""
