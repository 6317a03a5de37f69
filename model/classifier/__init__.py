"""The integer classifier: parameters, arithmetic, timing, and file."""
