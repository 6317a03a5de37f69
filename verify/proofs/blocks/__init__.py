"""What is proved of every block: one checker a file."""
