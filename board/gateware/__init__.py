"""Gateware around the chip: serial line, frames, sample loader, event records, and AER receiver."""
