"""Code that runs inside the simulator: pins, drivers, receivers, scoreboards, references, stimuli."""
