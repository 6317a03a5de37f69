// $top: a readout of $rows x $columns taxels behind the pins of Tiny Tapeout.
// SPDX-License-Identifier: Apache-2.0
`default_nettype none

module $top (
    input  wire [7:0] ui_in,
    output wire [7:0] uo_out,
    input  wire [7:0] uio_in,
    output wire [7:0] uio_out,
    output wire [7:0] uio_oe,
    input  wire       ena,
    input  wire       clk,
    input  wire       rst_n
);
  // The reset begins at once and ends with the clock.
  reg [1:0] reset_flops;
  always @(posedge clk or negedge rst_n)
    if (!rst_n) reset_flops <= 2'b11;
    else reset_flops <= {reset_flops[0], 1'b0};
  wire rst = reset_flops[1];

  wire [$last_sample_bit:0] sample;
  wire sample_valid, refused, spi_miso, spi_miso_enable;
  wire $request_wires;
  wire [$last_address_bit:0] aer_addr;

  eskin_loader loader (
      .clk(clk), .rst(rst),
      .sck(ui_in[0]), .mosi(ui_in[1]), .cs_n(ui_in[3]),
      .sample(sample), .sample_valid(sample_valid), .refused(refused)
  );

  eskin_readout readout (
      .clk(clk), .rst(rst),
      .taxel_enable({$taxels{ui_in[5]}}),
      .sample(sample), .sample_valid(sample_valid),
      .spi_sck(ui_in[0]), .spi_mosi(ui_in[1]), .spi_cs_n(ui_in[2]),
      .spi_miso(spi_miso), .spi_miso_enable(spi_miso_enable),
$request_ports
      .aer_ack(ui_in[4]), .aer_addr(aer_addr)
  );

  assign uo_out = {4'b0, $request_pins, refused, spi_miso & spi_miso_enable};
  assign uio_out = $address_pins;
  assign uio_oe = 8'h$output_enables;

  wire _unused = &{ena, ui_in[7:6], uio_in, 1'b0};
endmodule
