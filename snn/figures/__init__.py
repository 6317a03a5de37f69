"""Fig. 8, Fig. 9 and confusion matrices: data first, then pictures drawn from the data."""
