"""Test single-flop upsets and hostile surroundings: their effects, and how long the effects last."""
