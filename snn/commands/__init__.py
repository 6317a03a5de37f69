"""The commands of ``python -m snn``: they parse and print, and hold no logic."""
