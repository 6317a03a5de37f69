"""Steps and benches of blocks, which tests and coverage play."""
