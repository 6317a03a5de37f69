// {{ ticks }} sample ticks of {{ config.clocks_per_sample }} clocks; {{ count }} events, as the model gives them.
module eskin_readout_tb;
  reg clk = 1'b0;
  reg rst = 1'b1;
  reg sample_valid = 1'b0;
  reg [{{ wide - 1 }}:0] sample = {{ wide }}'h0;
  reg [{{ wide - 1 }}:0] samples [0:{{ ticks - 1 }}];
  reg [{{ width - 1 }}:0] expected [0:{{ [count - 1, 0] | max }}];
  wire event_valid;
{% for name, bits in present %}
  wire [{{ bits - 1 }}:0] {{ name }};
{% endfor %}
  integer seen = 0;
  integer errors = 0;
  integer tick;
  eskin_readout readout(.clk(clk), .rst(rst), .taxel_enable({ {{- config.taxels }}{1'b1}}), .sample(sample),
      .sample_valid(sample_valid), .event_valid(event_valid), .event_ready(1'b1)
{%- if tied %}, .{{ tied }}(1'b0){% endif %}
{%- for name, _ in present %}, .{{ name }}({{ name }}){% endfor %});
  always #5 clk = ~clk;
  always @(negedge clk)
    if (!rst && event_valid) begin
      if (seen >= {{ count }} || {{ seen }} !== expected[seen]) errors = errors + 1;
      seen = seen + 1;
    end
  initial begin
{% for word in samples %}
    samples[{{ loop.index0 }}] = {{ wide }}'h{{ "%x" | format(word) }};
{% endfor %}
{% for word in expected %}
    expected[{{ loop.index0 }}] = {{ width }}'h{{ "%x" | format(word) }};
{% endfor %}
    repeat (3) @(negedge clk);
    rst = 1'b0;
    for (tick = 0; tick < {{ ticks }}; tick = tick + 1) begin
      sample = samples[tick];
      sample_valid = 1'b1;
      @(negedge clk) sample_valid = 1'b0;
      repeat ({{ config.clocks_per_sample - 1 }}) @(negedge clk);
    end
    repeat ({{ count + 4 * config.taxels + 16 }}) @(negedge clk);
    if (errors == 0 && seen == {{ count }} && seen > 0) begin
      $display("PASSED: %0d events", seen);
      $finish;
    end
    $fatal(1, "FAILED: %0d of {{ count }} events, %0d of them wrong", seen, errors);
  end
endmodule
