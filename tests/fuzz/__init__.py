"""Hostile files and options: one sentence and exit code 2, or a right result; never a traceback or half a file."""
