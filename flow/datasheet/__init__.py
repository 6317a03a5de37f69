"""Datasheets with timing diagrams, generated for one configuration."""
