// Points of the merge: {{ tiles }} tiles.
{% for tile in range(tiles) %}
`COVER(event_of_tile_{{ tile }}_taken, tile_valid[{{ tile }}] && tile_ready[{{ tile }}])
`COVER(tile_{{ tile }}_alone_offers, tile_valid == {{ 2 ** tile }})
{% endfor %}
`COVER(a_later_tile_has_its_turn, comes && |(tile_valid[{{ tiles - 1 }}:1] & behind))
`COVER(the_turn_wraps, comes && behind != 0 && !(|(tile_valid[{{ tiles - 1 }}:1] & behind)))
`COVER(the_same_tile_twice, comes && $past(comes) && chosen == $past(chosen) && $past({{ tiles }} > 1))
`COVER(all_tiles_offer, &tile_valid)
`COVER(no_tile_offers, !(|tile_valid) && !rst)
`COVER(taken_while_empty, comes && !event_valid)
`COVER(taken_as_one_leaves, comes && event_valid && event_ready)
`COVER(taken_while_the_sink_stalls, comes && event_valid && !event_ready)
`COVER(full_and_tiles_wait, full && |tile_valid && !event_ready)
`COVER(full_and_one_leaves, full && event_valid && event_ready)
`COVER(runs_empty, event_valid && event_ready && !full && !comes)
`RESETS(while_full, full)
`RESETS(with_one_event_held, event_valid && !full)
{% if config.tile.has_polarity %}
`COVER(on_leaves, event_valid && event_ready && event_polarity)
`COVER(off_leaves, event_valid && event_ready && !event_polarity)
{% endif %}
