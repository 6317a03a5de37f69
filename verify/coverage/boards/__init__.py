"""The board in the runs of ``make coverage``: its Verilog, a host bit by bit, and what it is held to."""
