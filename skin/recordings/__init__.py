"""Read a user's recordings, and convert them to codes with a suitable configuration."""
