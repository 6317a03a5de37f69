"""FPGA board with readout and classifier: gateware, protocol and host software (docs/reference/board.md)."""
