"""Trained networks and events for other libraries: NumPy archives, NIR, torch transforms."""
