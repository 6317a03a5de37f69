// Points of a classifier: {{ config.readout }}, reset to {{ config.neuron_reset }}, {{ config.membrane_bits }} bits, {{ config.classes }} classes.
`COVER(event_taken_at_rest, event_valid && event_ready && state == 0)
`COVER(event_taken_as_the_one_before_ends, event_valid && event_ready && state == 1)
`COVER(event_waits_for_the_end_of_a_bin_that_is_due, event_valid && !event_ready && state == 0 && pending)
`COVER(stall_counted, stall_count != 0)
`COVER(stalls_forgotten, scan_start && stall_count != 0)
`COVER(bin_ends_with_an_event, bin_end && event_valid && event_ready)
`COVER(bin_ends_while_one_is_due, bin_end && pending && !scan_start)
`COVER(bin_ends_in_the_clock_in_which_a_scan_begins, bin_end && scan_start)
`COVER(overrun_flagged, overrun && !$past(overrun))
`COVER(overrun_forgotten, scan_start && overrun)
`RESETS(in_the_middle_of_work, state > 1)
`COVER(hidden_potential_above_0_no_spike, hidden_valid && hidden_potential > 0 && !hidden_spike)
`COVER(hidden_potential_below_0, hidden_valid && hidden_potential < 0)
{% for state in ("at_rest", "adding_an_event", "adding_recurrent_spikes", "comparing", "in_the_gap", "adding_to_outputs", "ending") %}
{% if loop.index0 %}
`COVER(event_waits_while_{{ state }}, event_valid && !event_ready && state == {{ loop.index0 }})
{% endif %}
`COVER(bin_ends_while_{{ state }}, bin_end && state == {{ loop.index0 }} && !scan_start)
`COVER(scan_begins_while_{{ state }}, scan_start && state == {{ loop.index0 }})
{% endfor %}
{% include "loads.sv" %}
{% for name, bits, floor, saturates in potentials %}
`COVER({{ name }}_neuron_fires, {{ name }}_valid && {{ name }}_spike)
`COVER({{ name }}_neuron_does_not_fire, {{ name }}_valid && !{{ name }}_spike)
{% if saturates %}
`COVER({{ name }}_potential_at_the_top, {{ name }}_valid && {{ name }}_potential == {{ highest(bits) }})
{% if floor is none %}
`COVER({{ name }}_potential_at_the_bottom, {{ name }}_valid && {{ name }}_potential == {{ lowest(bits) }})
{% endif %}
{% endif %}
{% if floor is not none %}
`COVER({{ name }}_potential_at_its_floor, {{ name }}_valid && {{ name }}_potential == {{ floor }})
{% endif %}
{% endfor %}
{% set evidence = config.evidence_bits %}
{% for number in range(config.classes) %}
`COVER(class_{{ number }}_found, class_valid && class_index == {{ number }})
{% endfor %}
{% if config.classes > 1 %}
`COVER(equal_evidence_the_first_stays, class_valid && evidence[0 +: {{ evidence }}] == evidence[{{ evidence }} +: {{ evidence }}] && class_index == 0)
`COVER(class_changes, class_valid && class_index != $past(class_index))
{% endif %}
{% if config.readout == "spikes" and evidence < 8 %}
`COVER(evidence_at_the_top, class_valid && $signed(evidence[0 +: {{ evidence }}]) == {{ highest(evidence) }})
{% endif %}
