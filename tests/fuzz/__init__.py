"""Fuzz tests: invalid files and options give an error message with exit code 2, or a correct result."""
