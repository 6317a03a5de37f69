"""One HTML page with the figures of the whole project."""
