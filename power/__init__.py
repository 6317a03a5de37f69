"""Power of the readouts: the published model, the same with corrections, and what follows from both."""
