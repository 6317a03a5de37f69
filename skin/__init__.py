"""Input signals: textures and their scans, and a user's recordings."""
