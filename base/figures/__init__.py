"""Figure style, and figure files."""
