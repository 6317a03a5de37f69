`timescale 1ns / 1ns
module play;
  harness #({{ parameters }}) h ();
  initial begin
    #1 h.go = 1;
    @(posedge h.running);
    #{{ before }} $dumpfile("{{ file }}"); $dumpvars(1, h.dut);
    #{{ inside }} $dumpoff;
    wait (h.done == 1);
    #8 $display("%0d", h.errors);
    $finish;
  end
endmodule
