// Points of all lines together: stalls, and tiles that overtake each other.
// {{ config.relays }} relay stations a line, {{ config.tiles }} tiles, {{ config.tile.encoding }}, reset {{ config.reset }}.
{% set stations = [] %}
{% for tile in range(config.tiles) %}
{% set line = each("relay_%d_{}" % tile, config.relays) %}
{% set _ = stations.extend(line) %}
`COVER(an_event_of_tile_{{ tile }}_in_every_station, {{ every(line, "{}.event_valid") }})
`COVER(the_stall_has_reached_tile_{{ tile }}, {{ every(line, "{}.full") }})
`COVER(event_of_tile_{{ tile }}_waits_for_another_tile, {{ line[-1] }}.event_valid && merge.comes && !merge.tile_ready[{{ tile }}])
`COVER(event_of_tile_{{ tile }}_alone_on_its_way, {{ line[0] }}.event_valid && !(|merge.tile_valid))
{% endfor %}
`COVER(all_stations_full, {{ every(stations, "{}.full") }})
`COVER(all_stations_empty, !rst && {{ every(stations, "!{}.event_valid") }})
`COVER(all_lines_offer, &merge.tile_valid)
`COVER(sample_tick_of_all_tiles, &sample_valid)
`COVER(sample_tick_while_a_stall_reaches_a_tile, (&sample_valid) && {{ any_of(stations, "{}.full") }})
