"""Evidence that the RTL is right: proofs, coverage, faults, mutants, soak, other tools."""
