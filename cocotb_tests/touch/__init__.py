"""Play the whole chain: textures or recordings through readout and classifier as one chip."""
