"""What leaves the array: address events in memory and on disk, and where two recordings differ."""
