"""The encoders of a taxel: one file each, and the registry of them all."""
