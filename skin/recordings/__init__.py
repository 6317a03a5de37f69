"""Read sensor recordings of a user, and convert them to codes with a suitable configuration."""
