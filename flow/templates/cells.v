`timescale 1ns / {{ "100ps" if delay_ns else "1ns" }}
{% for cell, memory, gate, outputs in cells %}
module {{ cell.name }} ({% for pin in cell.inputs + cell.outputs %}{{ "input" if pin in cell.inputs else "output" }} {{ pin }}{{ ", " if not loop.last }}{% endfor %});
{% if memory %}
{% set state = memory.state %}
  reg {{ state }};
  wire {{ memory.inverse }} = ~{{ state }};
{% if memory.is_flop %}
  wire clock_ = {{ memory.when | verilog }}, next_ = {{ memory.stored | verilog }}, clear_ = {{ memory.clear | verilog }}, preset_ = {{ memory.preset | verilog }};
  reg before_;
  always @(clock_ or clear_ or preset_) begin
    if (clear_ === 1'b1 && preset_ === 1'b1) {{ state }} <= 1'b{{ 1 if memory.both == "H" else 0 }};
    else if (clear_ === 1'b1) {{ state }} <= 1'b0;
    else if (preset_ === 1'b1) {{ state }} <= 1'b1;
    else if (clear_ === 1'bx && {{ state }} !== 1'b0) {{ state }} <= 1'bx;
    else if (preset_ === 1'bx && {{ state }} !== 1'b1) {{ state }} <= 1'bx;
    else if (before_ === 1'b0 && clock_ === 1'b1) {{ state }} <= next_;
    else if (before_ !== clock_ && (before_ === 1'bx || clock_ === 1'bx) && before_ !== 1'b1 && clock_ !== 1'b0 && {{ state }} !== next_) {{ state }} <= 1'bx;
    before_ = clock_;
  end
{% else %}
  wire open_ = {{ memory.when | verilog }}, data_ = {{ memory.stored | verilog }}, clear_ = {{ memory.clear | verilog }}, preset_ = {{ memory.preset | verilog }};
  always @(open_ or data_ or clear_ or preset_)
    if (clear_ === 1'b1) {{ state }} = 1'b0;
    else if (preset_ === 1'b1) {{ state }} = 1'b1;
    else if (open_ === 1'b1) {{ state }} = data_;
    else if ((open_ === 1'bx || clear_ === 1'bx || preset_ === 1'bx) && {{ state }} !== data_) {{ state }} = 1'bx;
{% endif %}
{% endif %}
{% if gate %}
  reg held_;
  wire open_ = {{ gate.opens }}, data_ = {{ gate.before }};
  always @(open_ or data_)
    if (open_ === 1'b1) held_ = data_;
    else if (open_ === 1'bx && held_ !== data_) held_ = 1'bx;
  assign {{ gate.output }} = {{ gate.clock }} {{ gate.gated }} {{ gate.behind }};
{% endif %}
{% for pin in outputs %}
  assign {{ "#%.1f " | format(delay_ns) if delay_ns }}{{ pin.name }} = {{ (pin.three_state | verilog) ~ " ? 1'bz : " if pin.three_state }}{{ pin.function | verilog }};
{% endfor %}
endmodule
{{ "" if loop.last else "\n" -}}
{% endfor %}
