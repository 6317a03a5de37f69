"""Data and plots of Fig. 8, Fig. 9, confusion matrices and studies."""
