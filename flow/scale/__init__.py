"""Area and highest clock frequency of growing arrays, with estimated wires and repeaters."""
