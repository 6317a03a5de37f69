"""Simulate textures or recordings on a chip with readout and classifier."""
