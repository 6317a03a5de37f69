"""The readout and its classifier on a board, as the host sees them (docs/reference/board.md)."""
