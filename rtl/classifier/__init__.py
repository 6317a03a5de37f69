"""The classifier behind the arbiter: memories, lanes, the core, and the chip that joins it to a readout."""
