"""Read cell libraries in Liberty format; cells are identified by function, not by name."""
