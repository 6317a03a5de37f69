"""Code that runs inside the simulator: drivers, receivers, scoreboards, reference models, stimuli."""
