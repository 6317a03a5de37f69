"""Readers of the files that people bring, one for each kind, and their registry by suffix."""
