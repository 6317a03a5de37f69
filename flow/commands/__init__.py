"""The commands of ``python -m flow``: they parse and print, and hold no logic."""
