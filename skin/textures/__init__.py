"""Texture images, scan presets, and event rates of scanned textures."""
