"""Make generated Verilog readable."""
