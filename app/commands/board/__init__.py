"""Commands: they parse options and print."""
