module {{ name }}_assertions(
{% for port, width in ports.items() %}
  input wire [{{ width - 1 }}:0] {{ port }}{{ "" if loop.last else "," }}
{% endfor %}
);
  reg started = 1'b0;
  always @(posedge clk) if (rst) started <= 1'b1;
  genvar index;
  generate for (index = 0; index < {{ count }}; index = index + 1) begin : each
{% for output in outputs %}
    wire {{ output }};
{% endfor %}
    {{ name }}_properties watcher({{ wires }});
    always @(posedge clk) if (started && !rst) begin
{% for property in checker.proved %}
      assert (ok_{{ property }});  // {{ checker.properties[property] }}
      cover (seen_{{ property }});
{% endfor %}
{% for assumption, meaning in checker.assumptions.items() %}
      assert (holds_{{ assumption }});  // assumed: {{ meaning }}
{% endfor %}
    end
  end endgenerate
endmodule

`ifndef YOSYS  // Yosys knows no bind: there the assertions are placed by hand
bind {{ module }} {{ name }}_assertions {{ name.removeprefix("eskin_") }}_assertions({{ bound }});
`endif
