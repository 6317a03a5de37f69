"""Convert recordings to tensors for the networks: time bins, scans, augmentation."""
