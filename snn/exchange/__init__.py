"""Exchange of trained networks and events with other libraries: NumPy archives, NIR, torch transforms."""
