"""Configurations and stimuli drawn by Hypothesis: RTL against golden model, and the smallest case that differs."""
