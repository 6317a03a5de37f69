"""A user's own recordings: files of samples in, codes and a configuration that suits them out."""
