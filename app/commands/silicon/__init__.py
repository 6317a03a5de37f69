"""Commands for chips and FPGAs."""
