"""Check the delivered Verilog with independent tools: another simulator, another parser and another solver."""
