"""The commands of ``python -m cocotb_tests``: they parse and print, and hold no logic."""
