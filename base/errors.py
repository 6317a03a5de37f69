"""The error for bad user input: commands print it as one sentence and exit with code 2."""


class InputError(ValueError):
    """Report bad input in one sentence that names the value and the remedy."""
