{{ header -}}
//
// Self-checking testbench: plays {{ ticks | length }} {{ what }}, and compares clock and value of
// {{ count }} {{ item }}s with the golden model. It prints PASS, or the first difference and FAIL,
// and then returns an error.
//   $ iverilog -g2012 -o bench *.v {{ top }}_tb.sv && vvp -n bench
//   $ verilator --binary --top {{ top }}_tb *.v {{ top }}_tb.sv
//   $ obj_dir/V{{ top }}_tb
module {{ top }}_tb;
  localparam int COUNT = {{ count }};
  localparam int END = {{ end }};  // clock of the end, and of the time-out

{% for port in ports %}
  {{ "reg" if port.driven else "wire" }} {{ port.range }}{{ port.name }}{{ " = " + port.initial if port.driven }};
{% endfor %}
  {{ top }} dut (
{% for port in ports %}
    .{{ port.name }}({{ port.name }}){{ "," if not loop.last }}
{% endfor %}
  );

  reg running = 1'b0;
  integer clock = 0;  // since the reset
  integer seen = 0;  // {{ item }}s that have left
  reg played = 1'b0;  // the stimulus is at its end
  reg [{{ bits + 31 }}:0] expected [{{ [count, 1] | max }}];  // {clock, {{ item }}}
  reg [{{ wide - 1 }}:0] played_samples [{{ ticks | length }}];
{% if ports | selectattr("name", "equalto", "sample") | list | length == 0 %}
  reg [{{ wide - 1 }}:0] sample = {{ wide }}'h0;
{% endif %}

  always #4 {{ clk }} = ~{{ clk }};
  always @(posedge {{ clk }}) if (running) clock <= clock + 1;

  task static show(input logic [{{ bits + 31 }}:0] found);
    $display("  clock %0d: {{ shown | join(", ") }}",
             found[{{ bits }}+:32]{% for low, width in fields %}, found[{{ low }}+:{{ width }}]{% endfor %});
  endtask

  task static fail(input string reason);
    $fatal(1, "FAIL: %0s in clock %0d", reason, clock);
  endtask

  task static check(input integer at, input logic [{{ bits - 1 }}:0] found);
    begin
      if (seen == COUNT) begin
        $display("more than %0d {{ item }}s; the next is:", COUNT);
        show({at, found});
        fail("unexpected {{ item }}");
      end else if ({at, found} !== expected[seen]) begin
        $display("{{ item }} %0d of %0d, expected and found:", seen + 1, COUNT);
        show(expected[seen]);
        show({at, found});
        fail("wrong {{ item }}");
      end
      seen = seen + 1;
    end
  endtask

  always @(posedge {{ clk }})
    if (clock == END) begin
      if (!played) fail("time-out");
      else if (seen < COUNT) begin
        $display("only %0d of %0d {{ item }}s; the next should be:", seen, COUNT);
        show(expected[seen]);
        fail("missing {{ item }}");
      end else begin
        $display("PASS: %0d {{ item }}s", seen);
        $finish;
      end
    end

{% for part in parts %}
{{ part }}
{% endfor %}
  integer tick;
  initial begin
{% for word in ticks %}
    played_samples[{{ loop.index0 }}] = {{ literal(word, wide) }};
{% endfor %}
{% for clock, value in expected %}
    expected[{{ loop.index0 }}] = {32'd{{ clock }}, {{ bits }}'h{{ "%x" | format(value) }}};
{% endfor %}
    repeat (3) @(negedge {{ clk }});
    {{ release }}
    running = 1'b1;
{% for line in before %}
    {{ line }}
{% endfor %}
    while (clock < {{ start }}) @(negedge {{ clk }});
    for (tick = 0; tick < {{ ticks | length }}; tick = tick + 1) begin
      sample = played_samples[tick];
      {{ strobe }} = 1'b1;
      @(negedge {{ clk }}) {{ strobe }} = 1'b0;
      repeat ({{ period - 1 }}) @(negedge {{ clk }});
    end
{% for line in after %}
    {{ line }}
{% endfor %}
    played = 1'b1;
  end
endmodule
