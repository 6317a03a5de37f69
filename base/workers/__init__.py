"""Do many pieces of work in parallel, on this machine or a cluster, with the same results."""
