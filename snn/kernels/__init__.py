"""One layer of integrate-and-fire neurons: its rule, the plain loop, and the same on CPU and GPU."""
