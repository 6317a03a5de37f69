"""Verification of the RTL: proofs, coverage, fault injection, mutants, random configurations, other tools."""
