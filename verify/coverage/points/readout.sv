// Points of a readout: {{ config.encoding }} {{ config.frontend }} {{ config.link }}, decisions every {{ config.decide_every }}.
// T is any taxel, in ROW and COLUMN.
{% set kinds = {"on": "T.polarity", "off": "!T.polarity"} if config.has_polarity else {"event": "1'b1"} %}
{% set req = any_of(config.protocol.requests, "link.{}") %}
{% set served = "arbiter.event_valid && arbiter.event_ready" %}
{% for kind, own in kinds.items() %}
{% set held = "T.request && " + own + " && " %}
`COVER({{ kind }}_held_by_the_sink, {{ some(held + "arbiter.event_valid && !arbiter.event_ready") }})
`COVER({{ kind }}_held_by_the_burst_of_its_own_row, {{ some(held + served + " && arbiter.event_row == ROW && !arbiter.granted[ROW]") }})
`COVER({{ kind }}_held_by_the_burst_of_another_row, {{ some(held + served + " && arbiter.event_row != ROW && !arbiter.takes") }})
`COVER({{ kind }}_held_by_another_row_that_is_granted, {{ some(held + "arbiter.takes && !arbiter.granted[ROW]") }})
{% if config.protocol.asynchronous %}
`COVER({{ kind }}_held_by_an_address_that_settles, {{ some(held + "link.setup") }})
`COVER({{ kind }}_held_by_ack_that_is_to_rise, {{ some(held + req + " && !aer_ack") }})
`COVER({{ kind }}_held_by_ack_that_passes_the_flops, {{ some(held + req + " && aer_ack && !link.ack_sync") }})
`COVER({{ kind }}_held_by_ack_that_is_to_fall, {{ some(held + "!" + req + " && aer_ack") }})
{% endif %}
{% endfor %}
{% for row in range(config.rows) %}
{% for size in range(1, config.columns + 1) %}
`COVER(burst_of_{{ size }}_in_row_{{ row }}, arbiter.granted[{{ row }}] && $countones(arbiter.column_request) == {{ size }})
{% endfor %}
{% for before in range(config.rows) %}
`COVER(row_{{ row }}_behind_row_{{ before }}, arbiter.granted[{{ row }}] && arbiter.event_row == {{ before }} && arbiter.event_valid)
{% endfor %}
{% endfor %}
`COVER(all_taxels_request, {{ every(taxels, "{}.request") }})
`COVER(latch_filled_while_empty, arbiter.takes && !arbiter.event_valid)
`COVER(latch_filled_as_its_last_event_leaves, arbiter.takes && arbiter.event_valid && arbiter.event_ready)
`COVER(latch_runs_empty, arbiter.event_valid && arbiter.event_ready && arbiter.load && !arbiter.takes)
`COVER(all_rows_request, &arbiter.row_request)
`COVER(nothing_requests_while_a_burst_is_drained, arbiter.event_valid && arbiter.event_ready && !(|arbiter.row_request))
`COVER(all_taxels_disabled, !rst && taxel_enable == 0)
`COVER(one_taxel_alone_enabled, !rst && $onehot(taxel_enable))
`RESETS(while_bursting, $countones(arbiter.waiting) > 1)
`RESETS(at_rest, !arbiter.awake && !arbiter.event_valid)
{% for old, was in kinds.items() %}
{% for new, now in kinds.items() %}
`COVER({{ new }}_raised_in_the_clock_in_which_{{ old }}_is_taken, {{ some("$past(T.pending && T.granted && T.asks && " + was + ") && T.pending && " + now) }})
{% endfor %}
{% endfor %}
{% include "comparators.sv" %}
`COVER(samples_in_two_clocks_running, sample_valid && $past(sample_valid))
`COVER(sample_in_the_first_clock_behind_a_reset, sample_valid && !rst && $past(rst))
`COVER(sample_while_a_request_waits, sample_valid && {{ some("T.pending && !T.granted") }})
`COVER(sample_in_the_clock_in_which_a_request_is_taken, sample_valid && {{ some("T.request && T.granted") }})
{% set crossed = "(T.above || T.below)" if config.has_polarity else "T.above" %}
{% if config.frontend == "analog" %}
{% set crossed = "T.compare && " ~ crossed %}
`COVER(asked_while_a_request_waits, {{ some("T.compare && T.pending && !T.granted && T.enable") }})
`COVER(not_asked_in_the_clock_in_which_a_request_is_taken, {{ some("!T.compare && T.request && T.granted") }})
{% if config.decide_every == "clock" %}
`COVER(asked_without_a_sample_before, {{ some("T.compare && !$past(sample_valid)") }})
{% endif %}
`COVER(the_comparators_are_ignored, {{ some("!T.compare && T.enable && !T.pending && T.above") }})
{% endif %}
`COVER(disabled_while_its_request_waits, {{ some("T.pending && !T.enable && !T.granted") }})
`COVER(disabled_in_the_clock_in_which_its_row_is_granted, {{ some("T.pending && !T.enable && T.granted") }})
`COVER(disabled_while_its_event_is_latched, {{ some("arbiter.waiting[COLUMN] && arbiter.event_row == ROW && !T.enable") }})
`COVER(disabled_at_rest, {{ some("T.enabled && !T.pending && !T.enable") }})
`COVER(disabled_for_a_single_clock, {{ some("T.enable && !$past(T.enable) && $past(T.enable, 2)") }})
`COVER(disabled_in_the_clock_in_which_it_would_ask, {{ some("!T.enable && $past(T.enable && !T.pending && !T.asks) && " + crossed) }})
`RESETS(while_a_request_waits, {{ some("T.pending") }})
{% if config.protocol.streams %}
`RESETS(while_the_sink_stalls, event_valid && !event_ready)
{% endif %}
{% if config.protocol.asynchronous %}
{% set news = some("T.pending && !$past(T.pending)") %}
`COVER(ack_rises_in_the_clock_of_a_new_request, aer_ack && $past(!aer_ack) && {{ news }})
`COVER(ack_falls_in_the_clock_of_a_new_request, !aer_ack && $past(aer_ack) && {{ news }})
`COVER(ack_has_fallen_while_the_next_event_waits, !link.ack_sync && $past(link.ack_sync) && !rst && !$past(rst) && link.event_valid)
`COVER(ack_has_fallen_and_no_event_waits, !link.ack_sync && $past(link.ack_sync) && !rst && !$past(rst) && !link.event_valid)
`COVER(event_offered_to_a_link_at_rest, link.event_valid && link.event_ready && !$past(link.event_valid))
`RESETS(while_an_address_settles, link.setup)
`RESETS(while_req_is_high, {{ req }} && !link.ack_sync)
`RESETS(while_ack_is_high, aer_ack)
{% endif %}
{% set bits, full_scale = config.sample_bits, config.full_scale %}
{% if config.frontend == "digital" %}
{% set codes = each("sample[{} +: %d]" % bits, config.taxels, bits) %}
`COVER(highest_code, sample_valid && {{ any_of(codes, "{} == %d'd%d" % (bits, full_scale - 1)) }})
`COVER(lowest_code, sample_valid && {{ any_of(codes, "{} == %d'd%d" % (bits, full_scale)) }})
{% endif %}
{% if config.encoder.leaks %}
{# All bits of a charge from the step on are 1, or 0. #}
{% set high, low = bits - 2 + config.fraction_bits, step_bits + config.fraction_bits %}
{% set sign = "T.charge[%d] && " % (high + 1) if config.has_polarity else "" %}
`COVER(charge_0_behind_a_charge, {{ some("T.charge == 0 && $past(T.charge) != 0 && !rst") }})
{% if config.frontend == "analog" %}
`COVER(a_step_up_that_would_leave_the_scale_is_not_made, {{ some("T.compare && T.above && T.enable && %s%s&T.charge[%d:%d]" % ("!" if sign else "", sign, high, low)) }})
{% if config.has_polarity %}
`COVER(a_step_down_that_would_leave_the_scale_is_not_made, {{ some("T.compare && T.below && !T.above && T.enable && %s~|T.charge[%d:%d]" % (sign, high, low)) }})
{% endif %}
{% endif %}
{% else %}
{% set width, name = bits - grid_bits, "reference_code" if config.frontend == "analog" and config.grid == 1 else "reference" %}
{% set top, bottom = "%d'h%x" % (width, 2 ** (width - 1) - 1), "%d'h%x" % (width, 2 ** (width - 1)) %}
{% set lowest = bottom if config.frontend == "analog" else "%d'h%x" % (width, 2 ** (width - 1) + 1) %}
`COVER(reference_at_the_top_level, {{ some("T.%s == %s" % (name, top)) }})
`COVER(reference_at_the_lowest_level_that_is_asked_for, {{ some("T.%s == %s" % (name, lowest)) }})
{% if config.frontend == "analog" %}
`COVER(a_step_up_that_would_leave_the_scale_is_not_made, {{ some("T.compare && T.above && T.enable && !T.fits && T.%s == %s" % (name, top)) }})
`COVER(a_step_down_that_would_leave_the_scale_is_not_made, {{ some("T.compare && T.below && T.enable && !T.fits && T.%s == %s" % (name, bottom)) }})
{% endif %}
{% endif %}
{% if config.closes %}
{% for width in range(1, 2 ** config.closing_levels_log2 + 1) %}
`COVER(window_{{ width }}_steps_wide, {{ some("T.window.half_width == %d" % width) }})
`COVER(event_in_a_window_{{ width }}_steps_wide, {{ some("T.asks && T.moves && T.window.half_width == %d" % width) }})
{% endfor %}
`COVER(event_in_the_clock_in_which_the_window_would_close, {{ some("T.window.open && T.window.tick && T.window.last && !T.window.closed") }})
`COVER(tick_while_a_request_waits, {{ some("T.tick && T.request && !T.granted") }})
`COVER(tick_in_a_closed_window, {{ some("T.window.tick && T.window.closed") }})
`COVER(closed_window_opened_by_the_mask, {{ some("T.window.closed && T.enabled && !T.enable") }})
{% endif %}
{% if config.encoder.leaks %}
{% for row in range(config.rows) %}
`COVER(leak_in_row_{{ row }}, row_{{ row }}.decay)
{% endfor %}
`COVER(event_and_leak_in_one_clock, {{ some("T.decay && T.moves && T.asks && T.enabled") }})
`COVER(leak_while_a_request_waits, {{ some("T.decay && T.request && !T.granted") }})
`COVER(leak_rounded_up, {{ some("T.decay && T.moves && !T.asks && T.enable && T.charge[%d]" % (config.leak_shift - 1)) }})
`COVER(leak_rounded_down, {{ some("T.decay && T.moves && !T.asks && T.enable && !T.charge[%d] && T.share != 0" % (config.leak_shift - 1)) }})
`COVER(leak_at_the_floor, {{ some("T.decay && T.moves && !T.asks && T.enable && T.share == 0 && T.charge != 0") }})
{% endif %}
