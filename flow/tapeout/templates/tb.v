// The chip for test.py.
`default_nettype none
`timescale 1ns / 1ps

module tb ();
  reg clk, rst_n, ena;
  reg [7:0] ui_in, uio_in;
  wire [7:0] uo_out, uio_out, uio_oe;
$instance
`ifdef WAVES
  initial begin
    $$dumpfile("tb.fst");
    $$dumpvars(0, tb);
  end
`endif
endmodule
