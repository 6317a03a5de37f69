"""Commands for the power model."""
