"""A second golden model, written from the specification alone. It imports nothing of the project."""
