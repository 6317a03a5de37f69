// Drives the readout (2 x 2, LCS, analog, four-phase) at random, for the assertions that are bound to it.
// +impatient: the receiver takes ACK back too early, which the assertions must notice.
module bound(input wire clk);
  reg rst = 1'b1;
  reg [3:0] taxel_enable = 4'h0, above = 4'h0, below = 4'h0;
  reg sample_valid = 1'b0;
  wire [3:0] compare;
  wire [47:0] reference_code;
  wire aer_req;
  reg aer_ack = 1'b0, req_before = 1'b0;
  wire [2:0] aer_addr;
  integer clocks = 0, events = 0;
  eskin_readout dut(.*);
  always @(negedge clk) begin
    clocks <= clocks + 1;
    rst <= clocks < 3 || clocks == 9000;
    req_before <= aer_req;
    if (aer_req && !req_before) events <= events + 1;
    if ($urandom % 40 == 0) taxel_enable <= 4'($urandom);
    sample_valid <= $urandom % 4 == 0;
    if ($urandom % 3 == 0) begin
      above <= 4'($urandom);
      below <= 4'($urandom);
    end
    if (aer_ack != aer_req && $urandom % 3 == 0 && clocks != 8999) aer_ack <= aer_req;
    else if ($test$plusargs("impatient") != 0 && aer_ack && clocks > 100) aer_ack <= 1'b0;
    if (clocks == 20000) begin
      $display("%0d events", events);
      $finish;
    end
  end
endmodule
