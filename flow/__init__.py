"""Design flow of the readout: its proofs."""
