"""HTML report with the figures of the whole project."""
