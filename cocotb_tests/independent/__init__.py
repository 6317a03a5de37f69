"""A second golden model, written only from the specification, without imports from the rest of the project."""
