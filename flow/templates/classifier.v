`timescale 1ns / 1ns
module play;
  reg clk = 0, rst = 1, running = 0;
  always #4 clk = ~clk;
  reg [63:0] cycle = 0, n = 0;
  reg [63:0] at [0:{{ events }}];
  reg [31:0] channel [0:{{ events }}];
{% for name, (words, bits) in memories.items() %}
  reg [{{ bits - 1 }}:0] {{ name }} [0:{{ words | length - 1 }}], {{ name }}_word = 0;
{% endfor %}
{% for name, bits in wires %}
  wire [{{ bits - 1 }}:0] {{ name }};
{% endfor %}
  assign event_valid = running && n < {{ events }} && cycle >= at[n];
  assign bin_end = running && cycle % {{ width }} == {{ width }} - 1;
  {{ top }} dut ({{ pins }});
  always @(posedge clk) begin
    if (running) begin
      cycle <= cycle + 1;
      if (event_valid && event_ready) begin
        $display("event %0d", cycle);
        n <= n + 1;
      end
      if (class_valid) $display("class %0d %0d %h", cycle, class_index, evidence);
      if (cycle == {{ clocks }}) $finish;
    end
{% for name in memories %}
    if ({{ name }}_read_valid) {{ name }}_word <= {{ name }}[{{ name }}_read_address];
{% endfor %}
  end
  initial begin
    $readmemh("at.hex", at);
    $readmemh("channel.hex", channel);
{% for name in memories %}
    $readmemh("{{ name }}.hex", {{ name }});
{% endfor %}
    repeat (4) @(posedge clk);
    rst <= 0;
    running <= 1;
  end
  initial begin
    @(posedge running);
    #{{ before }} $dumpfile("{{ file }}"); $dumpvars(1, dut);
    #{{ inside }} $dumpoff;
  end
endmodule
