// Points of a board, {{ config.design }}.
`COVER(a_word_finds_no_room, w_en && !w_rdy)
`COVER(memory_full, level == {{ records }})
`COVER(memory_empty, level == 0 && !rst)
`COVER(high_bits_of_the_time_told, told != 0)
`RESETS(while_words_wait, level != 0)
{% if config.chip %}
`COVER(class_decided_early, class_valid && class_sure)
`COVER(class_not_decided, class_valid && !class_sure)
{% endif %}
