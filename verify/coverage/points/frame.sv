// Points of the frame readout {{ config.rows }} x {{ config.columns }}, {{ bits }} bits in words of {{ config.word_bits }}.
{% set placed = "packer.sample_valid && packer.free && !packer.flush" %}
{% set waits = "sequencer.sample_valid && !sequencer.sample_ready" %}
`COVER(frame_begun_at_rest, frame_start && !sequencer.scanning && !packer.awake && !word_valid)
`COVER(frame_begun_while_words_of_the_one_before_wait, frame_start && !sequencer.scanning && word_valid)
`COVER(start_missed, frame_start && sequencer.scanning && !sequencer.taken)
`COVER(start_missed_in_the_clock_in_which_the_frame_ends, frame_start && sequencer.taken && sequencer.frame_ends)
`COVER(start_in_the_clock_behind_the_end, frame_start && $past(sequencer.taken && sequencer.frame_ends))
`COVER(starts_missed_in_two_clocks_running, frame_overrun && $past(frame_overrun))
`RESETS(within_a_conversion, sequencer.converting)
`RESETS(while_a_word_waits, word_valid && !word_ready)
`RESETS(while_a_multiplexer_settles, sequencer.scanning && sequencer.settling != 0)
`COVER(lowest_code, sequencer.taken && adc_code == {{ bits }}'d{{ 2 ** (bits - 1) }})
`COVER(highest_code, sequencer.taken && adc_code == {{ bits }}'d{{ 2 ** (bits - 1) - 1 }})
`COVER(code_in_the_clock_behind_the_start, sequencer.taken && $past(adc_start))
`COVER(code_two_n_clocks_behind_the_start, sequencer.taken && $past(adc_start, {{ 2 * bits }}))
`COVER(done_without_a_conversion, adc_done && !sequencer.converting)
`COVER(done_still_high_at_the_next_start, adc_start && adc_done)
`COVER(code_waits_for_the_packer, {{ waits }})
`COVER(conversion_waits_for_the_code_before, {{ waits }} && sequencer.scanning && !sequencer.converting && sequencer.settling == 0)
`COVER(word_waits_for_the_sink, word_valid && !word_ready)
`COVER(first_word_of_a_frame_taken, word_valid && word_ready && word_sync)
`COVER(sink_ready_without_a_word, !word_valid && word_ready)
{% for row in range(config.rows) %}
{% for column in range(config.columns) %}
`COVER(conversion_of_taxel_{{ row }}_{{ column }}, adc_start && row_select == {{ 2 ** row }} && column_select == {{ 2 ** column }})
{% endfor %}
{% endfor %}
{% if config.word_bits != bits %}
{# A code is put only where no word waits; so a word meets another if two codes that end one follow each other. #}
{% if words.follow %}
`COVER(word_taken_as_the_next_is_filled, word_valid && word_ready && packer.emits)
{% endif %}
{% for place in words.places %}
`COVER(code_put_at_bit_{{ place }}, {{ placed }} && packer.fill == {{ place // words.grain }})
{% endfor %}
{% if config.taxels * bits > config.word_bits %}
`COVER(word_completed, {{ placed }} && packer.complete{{ " && packer.remains != 0" if words.cut }})
{% endif %}
{% if words.padded %}
`COVER(last_word_filled_up, packer.flush && packer.free)
{% endif %}
{% if words.waits %}
`COVER(last_word_waits_for_the_one_before, packer.flush && !packer.free)
{% endif %}
{% endif %}
