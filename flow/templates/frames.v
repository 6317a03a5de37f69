`timescale 1ns / 1ns
module play;
  reg clk = 0, rst = 1, test_enable = 0;
{% for name in given %}
  reg [{{ widths[name] - 1 }}:0] {{ name }} = 0;
{% endfor %}
{% for name in seen %}
  wire [{{ widths[name] - 1 }}:0] {{ name }};
{% endfor %}
  reg [{{ wide - 1 }}:0] inputs [0:{{ clocks - 1 }}];
  reg [{{ broad - 1 }}:0] outputs [0:{{ clocks - 1 }}];
  integer t, wrong = 0;
  {{ top }} dut ({% for name in ports %}.{{ name }}({{ name }}){{ ", " if not loop.last }}{% endfor %});
  initial begin
    $readmemb("inputs.txt", inputs);
    $readmemb("outputs.txt", outputs);
    repeat (4) begin #4 clk = 1; #4 clk = 0; end
    rst = 0;
    { {{- given | join(", ") -}} } = inputs[0];
    $dumpfile("{{ file }}"); $dumpvars(1, dut);
    for (t = 0; t < {{ clocks }}; t = t + 1) begin
      { {{- given | join(", ") -}} } = inputs[t];
      #3;
      if ({ {{- seen | join(", ") -}} } !== outputs[t]) wrong = wrong + 1;
      #1 clk = 1;
      #4 clk = 0;
    end
    #4 $dumpoff; $display("%0d", wrong);
    $finish;
  end
endmodule
