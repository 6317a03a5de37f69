"""Figures of the power model."""
