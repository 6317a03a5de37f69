"""The encoders of a taxel: one file for each, and their registry."""
