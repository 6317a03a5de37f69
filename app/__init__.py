"""What the command lines of all packages share: app and errors, the configuration as options, tables, progress."""
