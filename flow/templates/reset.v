`timescale 1ns / 1ns
module bench;
{% for port in ports %}
  {{ "reg" if port.direction == "input" else "wire" }} [{{ port.nets | length - 1 }}:0] {{ port.name }};
{% endfor %}
  {{ top }} dut ({% for port in ports %}.{{ port.name }}({{ port.name }}){{ ", " if not loop.last }}{% endfor %});
  initial begin
    clk = 0; rst = 1;
    repeat ({{ reset_clocks }}) begin #4 clk = 1; #4 clk = 0; end
    #1 $display("%b", { {{- state | join(", ") -}} });
{% for port in ports if port.direction == "input" and port.name not in ("clk", "rst") %}
    {{ port.name }} = 0;
{% endfor %}
    #1 rst = 0;
    repeat ({{ quiet_clocks }}) begin #4 clk = 1; #4 clk = 0; end
    #1 $display("%b", { {{- state | join(", ") -}} });
    $display("%b", { {{- outputs | join(", ") -}} });
    $finish;
  end
endmodule
