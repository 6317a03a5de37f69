{{ header }}
# Clock: {{ base }}. Tighten it to what the technology should reach.
set period_ns {{ "%.6g" | format(1e9 / config.clock_hz) }}
create_clock -name {{ clock }} -period $period_ns [get_ports { {{- clock -}} }]
# Jitter, and the skew of a clock tree that is still to be made. Times are in ns, capacitances in pF.
set_clock_uncertainty -setup [expr {{ UNCERTAINTY }} * $period_ns] [get_clocks {{ clock }}]
set_clock_uncertainty -hold {{ HOLD_NS }} [get_clocks {{ clock }}]

# Edges at the inputs, and loads. With your library name a buffer of middle size instead, no delay cell:
# set_driving_cell -lib_cell BUFFER
set_input_transition {{ EDGE_NS }} [get_ports { {{- driven -}} }]
set_input_transition {{ CLOCK_EDGE_NS }} [get_ports { {{- clock }} {{ reset -}} }]
set_load -pin_load {{ LOAD_PF }} [all_outputs]

# A fifth of the period belongs to whatever drives an input or takes an output.
{% if config.reset == "async" and not synchronised %}
# {{ reset }} is asserted at any time and released in step with the clock.
{% endif %}
set_input_delay [expr {{ OUTSIDE }} * $period_ns] -clock {{ clock }} [get_ports { {{- inputs -}} }]
set_output_delay [expr {{ OUTSIDE }} * $period_ns] -clock {{ clock }} [get_ports { {{- outputs -}} }]
{% if decisions and references %}

# References and strobes leave early and decisions come late: DACs and comparators have what is between.
set_input_delay [expr {{ DECISION_IN }} * $period_ns] -clock {{ clock }} [get_ports { {{- decisions -}} }]
set_output_delay [expr {{ DAC_OUT }} * $period_ns] -clock {{ clock }} [get_ports { {{- references -}} }]
{% endif %}
{% if ack %}

# Asynchronous; two flops in the link take it.
set_false_path -from [get_ports { {{- ack -}} }]
{% endif %}
{% if spi %}

# Asynchronous; two flops in the SPI slave take each.
set_false_path -from [get_ports { {{- spi -}} }]
{% endif %}
{% if synchronised %}

# Begins at any time; two flops of the chip end it in step with the clock.
set_false_path -from [get_ports { {{- synchronised -}} }]
{% endif %}
{{ end -}}
