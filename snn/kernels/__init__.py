"""One layer of integrate-and-fire neurons: its rule, a plain loop, and kernels for CPU and GPU."""
