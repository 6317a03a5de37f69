// Points of the test pattern: {{ config.encoding }}.
`COVER(round_complete, goes_on && last)
`COVER(row_complete, goes_on && last_column && !last)
`COVER(switched_off_while_a_request_waits, restart && request && mode == 0)
{% for mode in (1, 2) %}
`COVER(mode_{{ mode }}_request_taken, taken && mode == {{ mode }})
`COVER(mode_{{ mode }}_request_waits, request && !taken && mode == {{ mode }} && !restart)
`COVER(mode_{{ mode }}_next_request_as_the_one_before_is_taken, rises && taken && mode == {{ mode }})
`COVER(mode_{{ mode }}_restart_while_a_request_waits, restart && request && mode == {{ mode }})
`COVER(mode_{{ mode }}_pause_between_requests, !request && count != 0 && mode == {{ mode }})
`COVER(mode_{{ mode }}_begun_at_the_last_taxel, restart && mode == {{ mode }} && row == {{ config.rows - 1 }} && column == {{ config.columns - 1 }})
{% endfor %}
{% for interval in range(16) %}
`COVER(interval_{{ interval }}, rises && interval == {{ interval }})
{% endfor %}
{% for row in range(config.rows) %}
{% for column in range(config.columns) %}
`COVER(request_of_taxel_{{ row }}_{{ column }}_taken, taken && at_row == {{ row }} && at_column == {{ column }})
{% endfor %}
{% endfor %}
{% if config.has_polarity %}
`COVER(mode_1_polarity_turns, taken && last && turns && mode == 1)
`COVER(mode_1_polarity_stays, taken && last && !turns && mode == 1)
`COVER(mode_2_polarity_turns, taken && last && turns && mode == 2)
`COVER(mode_2_polarity_stays, taken && last && !turns && mode == 2)
`COVER(first_event_on, restart && on && mode != 0)
`COVER(first_event_off, restart && !on && mode != 0)
{% endif %}
