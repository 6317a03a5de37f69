"""Commands for signals and events."""
