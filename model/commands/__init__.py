"""The commands of ``python -m model``: they parse and print, and hold no logic."""
