"""Compare the classifier's RTL with the model in every clock, for random networks and events."""

from pathlib import Path
from typing import Any

import pytest

from eskin.cocotb_tests.blocks.classifier import PROPERTIES, SCANS, cosimulate
from eskin.model.classifier.config import ClassifierConfig


def network_of(inputs: int, hidden: int, classes: int, lanes: int, **own: Any) -> ClassifierConfig:
    """Return a classifier configuration with thresholds at which several neurons fire."""
    base = {"threshold": 300, "out_threshold": 200, "clocks_per_bin": 64 * hidden}
    return ClassifierConfig(**(base | own), inputs=inputs, hidden=hidden, classes=classes, lanes=lanes)


FIRING = {"floor": -300, "out_floor": -200}
CONFIGS = [
    network_of(5, 12, 3, 4, margin=3, **FIRING),
    network_of(1, 1, 1, 1, reset="async", threshold=30, out_threshold=20, **FIRING),
    network_of(2, 1, 3, 4, threshold=40, **FIRING),
    network_of(3, 9, 2, 1, neuron_reset="subtract", leak_shift=3, reset="async", **FIRING),
    network_of(7, 10, 6, 4, neuron_reset="subtract", floor=-50, membrane_bits=10, out_leak_shift=2),
    network_of(4, 16, 5, 2, in_bits=2, rec_bits=3, out_bits=5, in_shift=5, rec_shift=2, threshold=60, **FIRING),
    network_of(
        16,
        33,
        4,
        16,
        in_bits=4,
        rec_bits=8,
        in_shift=3,
        leak_shift=1,
        readout="membrane",
        out_leak_shift=4,
        margin=600,
    ),
    network_of(8, 20, 3, 8, membrane_bits=10, output_bits=9, evidence_bits=5, in_shift=3, rec_shift=6, out_shift=4),
    network_of(6, 8, 7, 8, bias_bits=16, bias_shift=2, out_bias_shift=3, membrane_bits=12, leak_shift=5, reset="async"),
    network_of(
        9, 17, 2, 32, bias_bits=2, out_bits=2, rec_bits=2, out_threshold=1, leak_shift=16, floor=0, out_floor=-3
    ),
]
SYNAPSE = {"synapse_shift": 8, "synapse_factor": 115, "leak_shift": 8, "leak_factor": 26}
OUT_SYNAPSE = {"out_synapse_shift": 1, "out_leak_shift": 8, "out_leak_factor": 115}
NARROW = {"membrane_bits": 11, "floor": -700, "readout": "membrane", "output_bits": 10}
SYNAPTIC = [
    network_of(4, 10, 3, 4, **SYNAPSE, **OUT_SYNAPSE, membrane_bits=32, output_bits=24),
    network_of(3, 5, 2, 1, **SYNAPSE, **OUT_SYNAPSE, **NARROW, neuron_reset="subtract", reset="async"),
]
"""Neurons with a synaptic current: one network with bits for all values, and one with sums that saturate."""
OWN = [
    network_of(5, 12, 3, 4, own_parameters=True, **FIRING),
    network_of(4, 9, 4, 2, own_parameters=True, neuron_reset="subtract", membrane_bits=11, reset="async"),
    network_of(5, 9, 3, 4, own_parameters=True, neuron_reset="delayed", floor=-300, membrane_bits=11),
    network_of(3, 7, 3, 2, neuron_reset="delayed", leak_shift=3, out_leak_shift=2, membrane_bits=11),
    network_of(6, 10, 3, 4, own_parameters=True, synapse_shift=3, readout="membrane", membrane_bits=14),
]
"""Neurons with a threshold and a leak of their own, with each kind of reset, and with a synaptic current."""
STACKS = [
    network_of(5, 13, 3, 4, layers=((0, 5, ()), (5, 13, (0,))), **FIRING),
    network_of(4, 18, 2, 4, layers=((0, 6, (0,)), (6, 11, (0, 1)), (11, 18, (1, 2))), own_parameters=True, **FIRING),
    network_of(
        6,
        11,
        3,
        8,
        layers=((0, 4, ()), (4, 11, (0, 1))),
        synapse_shift=3,
        readout="membrane",
        membrane_bits=14,
        margin=1200,
    ),
]
"""Groups that begin within a word of weights: feed-forward, three recurrent groups, and synaptic currents."""


def name(config: ClassifierConfig) -> str:
    """Return the name of a configuration in the list of tests."""
    return f"{config.inputs}-{config.hidden}-{config.classes}-{config.lanes}l-{config.reset}"


@pytest.mark.representative("2-1-3", "16-33-4-16l", "6-8-7-8l", "4-9-4-2l", "5-13-3-4l")
@pytest.mark.parametrize("config", CONFIGS + SYNAPTIC + OWN + STACKS, ids=name)
def test_rtl_equals_the_model_in_every_potential_class_and_clock(config: ClassifierConfig, tmp_path: Path) -> None:
    counts = cosimulate(config, "icarus", tmp_path, config.hidden)
    assert counts["events"] > 100
    assert counts["bins"] > 10
    assert counts["hidden spikes"] > 5
    assert counts["output spikes"] > 5 or config.readout == "membrane"
    assert counts["stalls"] > 100
    assert counts["overruns"] > 3
    assert counts["resets"] > 2
    assert counts["scan starts"] > 0
    assert config.classes == 1 or counts["classes"] > 3
    assert bool(config.margin) == (counts["early decisions"] > 0)
    assert counts["early decisions"] < counts["runs"]
    assert bool(counts["at an end"]) == config.saturates or config.hidden < 8
    assert all(counts[property_name] > 0 for property_name in (*PROPERTIES, "ClassHeldBetweenBins")), counts


def test_a_scan_may_begin_at_any_time(tmp_path: Path) -> None:
    counts = cosimulate(CONFIGS[0], "icarus", tmp_path, 1, "scans_begin_at_any_time")
    assert counts["scan starts"] == SCANS - 1
    assert counts["overruns"] > 3
