"""The hardware classifier: memories, lanes, core, and the chip with readout and classifier."""
