"""What goes into an FPGA beside the chip: the serial line, frames, the sample loader, records, the AER receiver."""
