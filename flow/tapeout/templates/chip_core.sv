// The core of a wafer.space chip: $top behind the pads of the template's padring.
// Inputs 0 to 7 are ui_in; bidirectional pads 0 to 7 are uo_out, 8 to 15 uio. All other pads are inputs without a use.
// SPDX-License-Identifier: Apache-2.0
`default_nettype none

module chip_core #(
    parameter NUM_INPUT_PADS = 12,
    parameter NUM_BIDIR_PADS = 40,
    parameter NUM_ANALOG_PADS = 2
) (
`ifdef USE_POWER_PINS
    inout  wire VDD,
    inout  wire VSS,
`endif
    input  wire clk,
    input  wire rst_n,
    input  wire [NUM_INPUT_PADS-1:0] input_in,
    output wire [NUM_INPUT_PADS-1:0] input_pu,
    output wire [NUM_INPUT_PADS-1:0] input_pd,
    input  wire [NUM_BIDIR_PADS-1:0] bidir_in,
    output wire [NUM_BIDIR_PADS-1:0] bidir_out,
    output wire [NUM_BIDIR_PADS-1:0] bidir_oe,
    output wire [NUM_BIDIR_PADS-1:0] bidir_cs,
    output wire [NUM_BIDIR_PADS-1:0] bidir_sl,
    output wire [NUM_BIDIR_PADS-1:0] bidir_ie,
    output wire [NUM_BIDIR_PADS-1:0] bidir_pu,
    output wire [NUM_BIDIR_PADS-1:0] bidir_pd,
    inout  wire [NUM_ANALOG_PADS-1:0] analog
);
  wire [7:0] uo_out, uio_out, uio_oe;

  $top core (
      .ui_in(input_in[7:0]), .uo_out(uo_out), .uio_in(bidir_in[15:8]), .uio_out(uio_out), .uio_oe(uio_oe),
      .ena(1'b1), .clk(clk), .rst_n(rst_n)
  );

  // Chip selects and enable rest high or low by pull resistors when nothing drives them.
  assign input_pu = {{(NUM_INPUT_PADS - 4) {1'b0}}, 4'b1100};
  assign input_pd = ~input_pu;
  assign bidir_out = {{(NUM_BIDIR_PADS - 16) {1'b0}}, uio_out, uo_out};
  assign bidir_oe = {{(NUM_BIDIR_PADS - 16) {1'b0}}, uio_oe, 8'hff};
  assign bidir_ie = ~bidir_oe;
  assign bidir_cs = '0;
  assign bidir_sl = '0;
  assign bidir_pu = '0;
  assign bidir_pd = bidir_ie;

  wire _unused = &{input_in[NUM_INPUT_PADS-1:8], bidir_in[NUM_BIDIR_PADS-1:16], bidir_in[7:0], 1'b0};
endmodule

`default_nettype wire
