"""Wrappers that connect a readout to the bus of a system on a chip."""
