"""Files, errors, workers, progress and the look of figures: used by every room, knows none of them."""
