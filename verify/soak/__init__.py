"""Soak test: RTL against model in random configurations for hours."""
