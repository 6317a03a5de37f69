"""Recordings as the tensors that the networks take: scans, time bins, augmentation."""
