"""The classifier: from address events to the class of a texture."""
