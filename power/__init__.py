"""Power of the readouts: the published model, corrections of this model, and studies."""
