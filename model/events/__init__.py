"""Address events in memory and in files, and comparison of recordings."""
