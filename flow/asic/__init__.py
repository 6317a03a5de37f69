"""From the readout to a gated netlist of a cell library, checked and measured."""
