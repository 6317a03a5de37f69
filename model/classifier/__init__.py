"""The classifier in whole numbers: its parameters, its arithmetic, its clocks, its file."""
