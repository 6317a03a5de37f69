"""Experiments: folds, cross-validation, sweeps, and trained networks."""
