"""Cells of a library as they behave, and the readout simulated in them."""
