"""One layer of integrate-and-fire neurons: reference loop, and kernels for CPU and GPU."""
