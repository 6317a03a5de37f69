"""Study readouts: accuracy, rate and power at equal noise; latency, rest, timing."""
