"""Descriptions of the ports of the classifier."""

from __future__ import annotations

CLASSIFIER_PORTS = {
    "load_valid": "write a word of weights; nothing else may be under way",
    "load_neurons": "1: into the memory of output weights and biases, 0: into that of rows",
    "load_address": "address of the word",
    "load_data": "the word, from its least significant bit on",
    "event_valid": "an event is offered",
    "event_ready": "the classifier takes the event at this edge",
    "event_channel": "channel of the event, below {inputs}",
    "bin_end": "the time bin ends with this clock",
    "scan_start": "forget potentials, spikes, evidence, overrun and stalls",
    "class_valid": "one clock: class and evidence of another bin are there",
    "class_index": "the class with the most evidence, the first among equals; held",
    "evidence": "of all classes, signed, {evidence_bits} bits each, class 0 in the least significant bits",
    "overrun": "a bin_end came while the work of the one before was not done; held until scan_start",
    "stall_count": "clocks in which an event waited since scan_start; stops at its end",
    "hidden_valid": "a hidden neuron is compared with its threshold",
    "hidden_index": "its number",
    "hidden_potential": "its potential, signed, {membrane_bits} bits",
    "hidden_spike": "it fires",
    "output_valid": "an output neuron is compared, or its potential counted",
    "output_index": "its number",
    "output_potential": "its potential, signed, {output_bits} bits",
    "output_spike": "it fires",
}
"""Meaning of every port; fields in braces are those of the configuration."""

WATCHED_PORTS = {
    "event_valid": "an event is offered within",
    "event_ready": "the classifier takes it at this edge",
    "event_channel": "its channel: row * columns + column, behind all taxels for OFF events kept apart",
}
"""Meaning of the ports that are outputs of a chip with readout and classifier."""
