"""Reader of cell libraries: it finds cells by their liberty description, never by their names."""
