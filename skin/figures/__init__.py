"""Pictures of events and signals."""
