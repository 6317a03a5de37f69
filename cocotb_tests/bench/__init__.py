"""Stimuli, drivers, and comparisons with the models."""
