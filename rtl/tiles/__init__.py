"""The merge of several readouts, the relay stations on the way to it, and the skin of them."""
