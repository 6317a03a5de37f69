"""The encoders of a taxel, one per file, and their registry."""
