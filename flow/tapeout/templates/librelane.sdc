
# LibreLane says whether the clock tree exists; its delays then count.
if { [info exists ::env(OPENLANE_SDC_IDEAL_CLOCKS)] && $::env(OPENLANE_SDC_IDEAL_CLOCKS) } {
  unset_propagated_clock [all_clocks]
} else {
  set_propagated_clock [all_clocks]
}
