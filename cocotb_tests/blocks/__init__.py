"""Co-simulations of blocks: testbench, cocotb test, and pytest interface."""
