"""Properties of every block, one checker per file."""
