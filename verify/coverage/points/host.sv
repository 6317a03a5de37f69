// Points of a readout with registers: {{ config.encoding }} {{ config.frontend }}. T is any taxel, in ROW and COLUMN.
{% set beyond = {"up": "T.enable && T.above && !T.fits && !T.pending", "down": "T.enable && T.below && !T.above && !T.fits && !T.pending"} if config.has_polarity else {"up": "T.enable && T.above && !T.on && !T.pending"} %}
{% for bits in range(1, config.resolution + 1) %}
{% set step = 2 ** (config.resolution - bits) %}
`COVER(a_taxel_asks_at_{{ bits }}_bits, host.step == {{ step }} && {{ some("T.asks") }})
{% for way, side in beyond.items() if config.frontend == "analog" %}
`COVER(a_step_{{ way }}_that_would_leave_the_scale_at_{{ bits }}_bits_is_not_made, host.step == {{ step }} && {{ some(side) }})
{% endfor %}
{% endfor %}
{% include "comparators.sv" %}
`COVER(resolution_written_while_an_event_waits_for_the_sink, host.registers.resolution_bits_written && arbiter.event_valid && !arbiter.event_ready)
`COVER(resolution_written_while_a_request_waits, host.registers.resolution_bits_written && |arbiter.row_request)
`COVER(cleared_while_bursting, host.registers.control_clear && $countones(arbiter.waiting) > 1)
`COVER(cleared_while_a_request_waits, host.registers.control_clear && $past(|arbiter.row_request))
`COVER(test_pattern_begins_while_a_burst_of_the_array_is_drained, host.pattern.testing && !$past(host.pattern.testing) && arbiter.event_valid)
`COVER(test_pattern_begins_while_a_request_of_the_array_waits, host.pattern.testing && !$past(host.pattern.testing) && $past(|arbiter.row_request))
`COVER(event_of_the_test_pattern_waits_for_the_sink, host.pattern.testing && arbiter.event_valid && !arbiter.event_ready)
`COVER(test_pattern_ends_while_its_event_is_latched, !host.pattern.testing && $past(host.pattern.testing) && arbiter.event_valid)
`COVER(mask_of_the_host_alone_silences, |(taxel_enable & ~host.enabled) && !host.pattern.testing)
`COVER(mask_from_outside_alone_silences, |(~taxel_enable & host.registers.mask_rest_taxels))
{% if config.encoder.leaks %}
`COVER(leak_restarted_in_the_clock_of_a_tick, ticks.restart && ticks.tick)
{% for shift in range(1, config.leak_shift + 1) %}
`COVER(leak_with_k_{{ shift }}, |ticks.decay && host.decay_shift == {{ shift }})
{% endfor %}
{% for period in range(config.rows, config.leak_period + 1) %}
`COVER(leak_with_p_{{ period }}, |ticks.decay && host.decay_period == {{ period }})
{% endfor %}
{% endif %}
{% if config.closes %}
{% for period in range(1, config.window_period + 1) %}
`COVER(window_closes_with_a_period_of_{{ period }}, host.window_period == {{ period }} && {{ some("T.window.tick && T.window.last && !T.window.closed") }})
{% endfor %}
{% endif %}
