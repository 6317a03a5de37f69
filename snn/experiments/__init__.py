"""Run experiments: folds, cross-validation, sweeps and their workers, and trained networks."""
