"""Gateware around the chip: serial line, frames, sample loader, records, and AER receiver."""
