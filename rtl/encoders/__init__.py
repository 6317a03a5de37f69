"""The encoders of a taxel in hardware: the same files as in ``model/encoders``, and the registry of them all."""
