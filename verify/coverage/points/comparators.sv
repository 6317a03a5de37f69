{% if config.frontend == "analog" and config.has_polarity %}
`COVER(both_comparators_fire, |(above & below))
{% endif %}
