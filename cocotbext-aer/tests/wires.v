// Buses whose two ends are the two sides of a module: in_ is driven by a source, out_ by a sink.
`timescale 1ns / 1ps
module wires (
    input clk,
    input rst,
    input in_req, output in_ack, input [7:0] in_addr,
    output out_req, input out_ack, output [7:0] out_addr,
    input dual_in_req_on, input dual_in_req_off, output dual_in_ack, input [7:0] dual_in_addr,
    output dual_out_req_on, output dual_out_req_off, input dual_out_ack, output [7:0] dual_out_addr,
    input AERIN_REQ, output AERIN_ACK, input [7:0] AERIN_ADDR,
    output AEROUT_REQ, input AEROUT_ACK, output [7:0] AEROUT_ADDR,
    input bare_in_req, output bare_in_ack, output bare_out_req, input bare_out_ack,
    input s_valid, output s_ready, input [2:0] s_col, input [4:0] s_row,
    output m_valid, input m_ready, output [2:0] m_col, output [4:0] m_row
);
  assign out_req = in_req;
  assign out_addr = in_addr;
  assign in_ack = out_ack;
  assign dual_out_req_on = dual_in_req_on;
  assign dual_out_req_off = dual_in_req_off;
  assign dual_out_addr = dual_in_addr;
  assign dual_in_ack = dual_out_ack;
  assign AEROUT_REQ = AERIN_REQ;
  assign AEROUT_ADDR = AERIN_ADDR;
  assign AERIN_ACK = AEROUT_ACK;
  assign bare_out_req = bare_in_req;
  assign bare_in_ack = bare_out_ack;
  assign m_valid = s_valid;
  assign m_col = s_col;
  assign m_row = s_row;
  assign s_ready = m_ready;
endmodule
