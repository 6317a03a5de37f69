"""Co-simulation: comparison of the RTL with the golden model in every event and clock."""
