"""Build the bitstream of a board: synthesis, place and route, and a report of area and clock."""
