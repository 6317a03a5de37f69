// Points of a chip: {{ config.readout.encoding }}.
`COVER(event_of_the_readout_taken_by_the_classifier, event_valid && event_ready)
`COVER(event_of_the_readout_waits_for_the_classifier, event_valid && !event_ready)
`COVER(class_while_an_event_waits, class_valid && event_valid && !event_ready)
`COVER(class_while_none_waits, class_valid && !event_valid)
`COVER(class_found, class_valid)
`COVER(sample_while_an_event_waits, sample_valid && event_valid && !event_ready)
`COVER(hidden_neuron_fires, hidden_valid && hidden_spike)
