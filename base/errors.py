"""The exception for bad user input: commands print its message and exit with code 2."""


class InputError(ValueError):
    """Raised for bad user input; the message names the value and the remedy."""
