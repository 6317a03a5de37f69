"""The merge of several readouts, and the skin of them."""
