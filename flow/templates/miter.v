// Each bit of `differ` is 0 where the outputs of both designs are equal.
module miter({% for name, width in inputs.items() %}input [{{ width - 1 }}:0] \{{ name }} , {% endfor %}output [{{ outputs.values() | sum - 1 }}:0] differ);
{% for side in ("gold", "gate") %}
{% for name, width in outputs.items() %}
  wire [{{ width - 1 }}:0] \{{ side }}_{{ name }} ;
{% endfor %}
  {{ side }} {{ side }}_side({% for name in inputs %}.\{{ name }} (\{{ name }} ), {% endfor %}{% for name in outputs %}.\{{ name }} (\{{ side }}_{{ name }} ){{ ", " if not loop.last }}{% endfor %});
{% endfor %}
  assign differ = { {%- for name in outputs | reverse %}\gold_{{ name }} ^ \gate_{{ name }} {{ ", " if not loop.last }}{% endfor -%} };
endmodule
