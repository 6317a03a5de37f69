read_liberty cells.lib
read_verilog netlist.v
link_design {{ top }}
# The shortest period without a negative slack is bracketed by doubling, and the bracket is closed to 4e-6 of it. Slacks
# mostly lie on a line, whose zero is looked at from a little above and a little below. Every third time the bracket is
# halved, since a slack is 0 for a wide range of periods if a latch borrows time.
set within 4e-6
set period 1.0
proc constrain {} { global period; uplevel #0 source constraints.sdc }
constrain
with_output_to_variable setup { check_setup -verbose }
puts "SETUP <<$setup>>"
proc look {new} {
  global period met missed spare lack
  set period $new
  constrain
  set slack [worst_slack -max]
  if {$slack < 0} { set missed $new; set lack $slack } else { set met $new; set spare $slack }
  return $slack
}
set slack [look $period]
while {$slack >= 0} { set slack [look [expr $period / 2]] }
while {$slack < 0 && $period < 1e6} { set slack [look [expr $period * 2]] }
if {$slack < 0} { set met $period; set missed $period }
for {set i 0} {$i < 40 && $met - $missed > $within * $met} {incr i} {
  set new [expr ($met + $missed) / 2]
  if {$i % 3 < 2} {
    set zero [expr $missed + ($met - $missed) * $lack / ($lack - $spare)]
    set near [expr $zero * (1 + ($i % 3 ? -1 : 1) * $within / 3)]
    if {$near > $missed && $near < $met} { set new $near }
  }
  look $new
}
set period $met
constrain
puts "PERIOD <<$period [worst_slack -max]>>"
set period [expr 0.999 * $period]
constrain
with_output_to_variable path { report_checks -path_delay max -digits 4 }
puts "PATH <<$path>>"
set period {{ own }}
constrain
puts "OWN <<[worst_slack -max] [worst_slack -min]>>"
