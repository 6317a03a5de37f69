"""Event files of other sensors and programs."""
