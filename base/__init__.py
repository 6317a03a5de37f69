"""Files, errors, worker pools, progress bars and figure style for all other packages."""
