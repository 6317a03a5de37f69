"""The look of the figures, and their files."""
