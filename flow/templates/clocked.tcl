set period {{ period }}
create_clock -name clk -period $period [get_ports clk]
set_propagated_clock [get_clocks clk]
set inputs { {{- inputs -}} }
set outputs { {{- outputs -}} }
proc say {what of body} { with_output_to_variable text $body; puts "$what $of <<[string trim $text]>>" }
proc leave {slew load} {
  global outputs
  set_input_transition $slew [get_ports clk]
  set_load $load [get_ports $outputs]
  foreach name $outputs {
    say "arrival $slew $load" $name "report_arrival $name"
    say "slew $slew $load" $name "report_slews $name"
  }
}
proc enter {clock data} {
  global inputs
  set_input_transition $clock [get_ports clk]
  set_input_transition $data [get_ports $inputs]
  foreach name $inputs { say "slack $clock $data" $name "report_slack $name" }
}
