"""Commands that check the project."""
