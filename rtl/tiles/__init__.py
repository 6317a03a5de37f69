"""Skins of several readouts: merge, relay stations and top module."""
