"""Skins of several readouts: their addresses, the merge of their events, and their simulation."""
