"""Co-simulation: the RTL against the golden model, event by event and clock by clock."""
