"""The encoders of a taxel in hardware, one per file as in ``model/encoders``, and their registry."""
