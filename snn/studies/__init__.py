"""Studies of readouts: accuracy, rate and power with noise; latency, rest and timing."""
