"""Many pieces of work side by side: on this machine, or on a cluster of machines, with the same results."""
