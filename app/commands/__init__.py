"""The commands: option parsing and printed output."""
