"""Skins of several tiles: addresses, merge of the event streams, and simulation."""
