"""The integer classifier: parameters, arithmetic, timing and files."""
