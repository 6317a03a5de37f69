{% for memory, words, chosen in (("rows", classifier.weight_words, "!load_neurons"), ("neurons", classifier.neuron_words, "load_neurons")) %}
`COVER(first_word_of_{{ memory }}_written, load_valid && {{ chosen }} && load_address == 0)
`COVER(last_word_of_{{ memory }}_written, load_valid && {{ chosen }} && load_address == {{ words - 1 }})
{% endfor %}
