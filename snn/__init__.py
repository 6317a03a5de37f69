"""The spiking classifier: from address events to a class."""
