// Points of a relay station: {{ config.tile.encoding }}, reset {{ config.reset }}.
`COVER(at_rest, !event_valid && !tile_valid && !rst)
`COVER(ready_without_an_event, !event_valid && event_ready && !rst)
`COVER(taken_while_empty, comes && !event_valid)
`COVER(taken_as_one_leaves, comes && event_valid && event_ready)
`COVER(taken_in_the_clock_of_a_stall, comes && event_valid && !event_ready)
`COVER(the_line_waits_for_a_full_station, full && tile_valid)
`COVER(full_and_one_leaves, full && event_valid && event_ready)
`COVER(full_for_several_clocks, full && $past(full) && $past(full, 2))
`COVER(the_second_place_moves_up_and_the_line_goes_on, comes && $past(full && event_valid && event_ready))
`COVER(runs_empty, event_valid && event_ready && !full && !comes)
`COVER(events_in_two_clocks_running, event_valid && event_ready && $past(event_valid && event_ready))
`RESETS(while_full, full)
`RESETS(with_one_event_held, event_valid && !full)
`RESETS(while_empty, !event_valid)
{% for name, bits in (("row", config.tile.row_bits), ("col", config.tile.column_bits)) if bits %}
`COVER(first_{{ name }}_leaves, event_valid && event_ready && event_{{ name }} == 0)
`COVER(last_{{ name }}_leaves, event_valid && event_ready && event_{{ name }} == {{ 2 ** bits - 1 }})
{% endfor %}
{% if config.tile.has_polarity %}
`COVER(on_leaves, event_valid && event_ready && event_polarity)
`COVER(off_leaves, event_valid && event_ready && !event_polarity)
{% endif %}
