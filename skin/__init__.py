"""Input signals: textures with their scans, and sensor recordings of a user."""
