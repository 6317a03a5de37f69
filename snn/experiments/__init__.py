"""Experiments: what a run consists of, folds, cross-validation, sweeps and their workers, trained networks."""
