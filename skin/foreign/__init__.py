"""Read and write event files of other sensors and programs."""
