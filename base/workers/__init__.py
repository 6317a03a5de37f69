"""Run tasks in parallel on this machine or on a cluster, with equal results, and store the results."""
