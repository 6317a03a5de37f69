// Points of the registers: {{ config.encoding }}.
{% for register in registers %}
{% set here = "at_" + plain(register) %}
{% set refused = "write && %s && !write_%s" % (here, plain(register)) %}
{% if not register.writable %}
`COVER({{ plain(register) }}_written_in_vain, write && {{ here }})
{% endif %}
{% for field in register.fields %}
{% set name, signal, low = plain(register) + "_" + field.name, register.signal(field), field.bits * (register.index or 0) %}
{% if field.kind == "pulse" %}
`COVER({{ name }}_told, {{ signal }})
{% elif field.kind == "setting" and field.bits %}
{% set value = "%s[%d +: %d]" % (signal, low, field.bits) if field.bits > 1 else signal %}
{% set data = "write_data[%d +: %d]" % (field.low, field.width) %}
`COVER({{ name }}_at_its_least, !rst && {{ value }} == {{ field.least }})
`COVER({{ name }}_at_its_most, !rst && {{ value }} == {{ field.most }})
{% for bit in range(field.bits) if field.bits > 1 or field.least <= 2 ** bit <= field.most %}
{% set own = "%s[%d]" % (signal, low + bit) if field.bits > 1 else signal %}
`COVER({{ name }}_bit_{{ bit }}_set, !rst && {{ own }})
`COVER({{ name }}_bit_{{ bit }}_clear, !rst && !{{ own }})
{% endfor %}
{% if field.least %}
`COVER({{ name }}_below_its_least_refused, {{ refused }} && {{ data }} == {{ field.least - 1 }})
{% endif %}
{% if field.most < 2 ** field.width - 1 %}
`COVER({{ name }}_above_its_most_refused, {{ refused }} && {{ data }} == {{ field.most + 1 }})
{% endif %}
{% endif %}
{% endfor %}
{% endfor %}
{% set holes = every(plains, "!at_{}") %}
`COVER(a_hole_written, write && {{ holes }})
`COVER(a_hole_in_front_of_the_address, {{ holes }} && !rst)
`COVER(events_counted, events_count_counts && !clear && !rst)
`COVER(events_cleared_in_a_clock_to_be_counted, events_count_counts && clear)
`COVER(events_cleared_from_above_0, events_count_bits != 0 && clear)
`COVER(stalls_counted, stalls_count_counts && !clear && !rst)
`COVER(stalls_cleared_in_a_clock_to_be_counted, stalls_count_counts && clear)
`COVER(stalls_cleared_from_above_0, stalls_count_bits != 0 && clear)
{% if config.resolution > 1 %}
`RESETS(of_what_was_set, resolution_bits != {{ config.resolution }})
{% else %}
`COVER(reset_of_what_was_set, rst)
{% endif %}
