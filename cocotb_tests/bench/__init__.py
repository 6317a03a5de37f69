"""Code that runs inside the simulator: drivers, receivers, scoreboards, stimuli."""
