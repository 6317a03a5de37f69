"""Address events in memory and on disk, and the differences of two recordings."""
