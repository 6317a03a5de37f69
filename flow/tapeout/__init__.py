"""Project folders for chip shuttles: pins, sources, test, documentation and flow settings."""
