"""Command lines: app and errors, the configuration as options, tables, progress."""
