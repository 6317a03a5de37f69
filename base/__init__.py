"""Provide files, errors, workers, progress bars and figure style to all other rooms."""
