"""Define the properties of every block: one checker in each file."""
