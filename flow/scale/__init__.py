"""How area and highest clock change as the array grows: wires of its size, with repeaters."""
