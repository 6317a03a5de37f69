"""Commands that compare RTL and model."""
