"""From the design of a board to a bitstream: synthesis, place and route, and what it costs."""
