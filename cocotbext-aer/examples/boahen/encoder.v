// An address-event transmitter in plain Verilog, written from K. A. Boahen, "Point-to-point connectivity between
// neuromorphic chips using address events", IEEE Trans. Circuits Syst. II 47(5):416-434, 2000: cells that request, a tree of
// two-input arbiters, an address encoder, and a four-phase channel with bundled address. It has no clock.
//
// Two bugs can be planted: BUG_ADDRESS encodes the cells that wait in place of the one that was chosen, without a latch;
// BUG_REQUEST ends the request by itself, without waiting for the acknowledge.
`timescale 1ns / 1ps

// Chooses between two requests and passes the winner's on; the loser waits until the winner's cycle is over.
module arbiter2 (
    input r0, input r1, output a0, output a1,
    output up_r, input up_a
);
  wire g0, g1;
  assign #0.10 g0 = r0 & ~g1 & (g0 | ~up_a);
  assign #0.12 g1 = r1 & ~g0 & (g1 | ~up_a);  // the slower one: a tie is broken
  assign up_r = g0 | g1;
  assign a0 = g0 & up_a;
  assign a1 = g1 & up_a;
endmodule

// A tree over 2^LEVELS requests.
module tree #(parameter LEVELS = 3) (
    input [(1<<LEVELS)-1:0] r, output [(1<<LEVELS)-1:0] a,
    output up_r, input up_a
);
  generate
    if (LEVELS == 1) begin : leaf
      arbiter2 arbiter (r[0], r[1], a[0], a[1], up_r, up_a);
    end else begin : node
      localparam HALF = 1 << (LEVELS - 1);
      wire low_r, high_r, low_a, high_a;
      tree #(LEVELS - 1) low (r[HALF-1:0], a[HALF-1:0], low_r, low_a);
      tree #(LEVELS - 1) high (r[2*HALF-1:HALF], a[2*HALF-1:HALF], high_r, high_a);
      arbiter2 arbiter (low_r, high_r, low_a, high_a, up_r, up_a);
    end
  endgenerate
endmodule

module encoder #(parameter LEVELS = 3) (
    input rst,
    input [(1<<LEVELS)-1:0] spike,  // a rising edge is an event of the cell
    output reg req, input ack, output reg [LEVELS-1:0] addr
);
  localparam CELLS = 1 << LEVELS;
  reg [CELLS-1:0] fired, served;
  wire [CELLS-1:0] waiting = fired ^ served;
  wire [CELLS-1:0] chosen;
  wire root;
  wire free;  // the channel may take an event: the acknowledge of the one before has gone
  assign #0.5 free = ~ack;

  genvar k;
  generate
    for (k = 0; k < CELLS; k = k + 1) begin : cells
      always @(posedge spike[k] or posedge rst)
        if (rst) fired[k] <= 0;
        else if (!waiting[k]) fired[k] <= ~fired[k];
      always @(posedge ack or posedge rst)
        if (rst) served[k] <= 0;
        else if (chosen[k]) served[k] <= fired[k];
    end
  endgenerate

  tree #(LEVELS) arbiters (waiting, chosen, root, root & free);

  function [LEVELS-1:0] encode(input [CELLS-1:0] cells);
    integer i;
    begin
      encode = 0;
      for (i = 0; i < CELLS; i = i + 1) if (cells[i]) encode = encode | i;
    end
  endfunction

`ifdef BUG_ADDRESS
  always @(*) addr = #0.2 encode(waiting);
`else
  always @(posedge |chosen or posedge rst) addr <= #0.2 (rst ? 0 : encode(chosen));
`endif

  always @(posedge |chosen or posedge ack or posedge rst)
    if (rst) req <= 0;
    else if (ack) req <= #0.5 0;
    else begin
      req <= #1.2 1;
`ifdef BUG_REQUEST
      req <= #6 0;
`endif
    end
endmodule
