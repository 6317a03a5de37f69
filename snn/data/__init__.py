"""Convert recordings to tensors for the networks: scans, time bins, augmentation."""
