read_liberty cells.lib
read_verilog netlist.v
link_design {{ top }}
create_clock -name clk -period {{ period }} [get_ports clk]
set_input_transition 0.1 [all_inputs]
foreach port [all_inputs] {
  if {[get_property $port full_name] != "clk"} { set_input_delay 0 -clock clk $port }
}
proc report {name activity} {
  set_power_activity -global -activity $activity -duty 0.5
  set out [open $name.txt w]
  foreach cell [get_cells *] {
    puts $out "[get_full_name $cell] [sta::instance_power $cell [sta::cmd_corner]]"
  }
  close $out
}
