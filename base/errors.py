"""The one error that a user can cause: every command prints it as one sentence and exits with code 2."""


class InputError(ValueError):
    """Raised for bad input; its text is one sentence that names the value and the remedy."""
