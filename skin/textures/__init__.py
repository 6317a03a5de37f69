"""Texture images, the presets that scan them, and their event rates."""
