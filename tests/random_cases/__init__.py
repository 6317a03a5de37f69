"""Random configurations and stimuli by Hypothesis: RTL compared with the golden model."""
