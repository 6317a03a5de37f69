{{ header }}
set period_ns {{ period }}
create_clock -name clk -period $period_ns [get_ports {clk}]
set_clock_uncertainty -setup [expr {{ delivery.UNCERTAINTY }} * $period_ns] [get_clocks clk]
set_clock_uncertainty -hold {{ delivery.HOLD_NS }} [get_clocks clk]

# rst is released in step with the clock; its tree, as the clock's, is made by layout.
{% for (way, share), names in delays.items() %}
set_{{ way }}_delay [expr {{ share }} * $period_ns] -clock clk [get_ports { {{- names | join(" ") -}} }]
{% endfor %}

{% if buffer %}
set_driving_cell -lib_cell {{ buffer.name }} -pin {{ buffer.drives(buffer.inputs[0]) }} [get_ports { {{- driven | join(" ") -}} }]
{% else %}
set_input_transition {{ delivery.EDGE_NS }} [get_ports { {{- driven | join(" ") -}} }]
{% endif %}
set_input_transition {{ delivery.CLOCK_EDGE_NS }} [get_ports {clk rst}]
set_load -pin_load {{ delivery.LOAD_PF }} [all_outputs]
{% if requests %}

# aer_ack comes at any time; two flops take it. The way to the first is short, so that it settles.
set_max_delay [expr 0.5 * $period_ns] -from [get_ports {aer_ack}]
# Bundled data: aer_addr stands a clock before aer_req rises, and less than a clock lies between their ways.
set_max_delay $period_ns -to [get_ports { {{- requests | join(" ") }} aer_addr[*]}]
{% endif %}
