"""What a readout is good for: accuracy, rate and power at one noise; latency, rest, timing."""
