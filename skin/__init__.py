"""Signals that go in: textures and their scans, and a user's recordings."""
