"""Coverage points of the classifier, and of the chip with readout and classifier."""

from __future__ import annotations

from collections.abc import Iterator

from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.config import ClassifierConfig, highest, lowest
from eskin.verify.coverage.points.point import Named, Point, points_of, table

STATES = (
    "at rest",
    "adding an event",
    "adding recurrent spikes",
    "comparing",
    "in the gap",
    "adding to outputs",
    "ending",
)


def classifier(config: ClassifierConfig) -> Iterator[Point]:
    """Return the coverage points of a classifier."""
    kind = f"{config.neuron_reset}, {config.membrane_bits} bits, {config.classes} classes"
    group = f"classifier {config.readout}, reset to {kind}"
    parts = (table("classifier"), _states(), loads(config), _ends(config), _classes(config))
    return points_of(group, "eskin_classifier", *parts)


def _states() -> Named:
    """Yield the points of events, bin ends and scan starts in every state."""
    for state, name in enumerate(STATES):
        if state:
            yield f"event waits while {name}", f"event_valid && !event_ready && state == {state}"
        yield f"bin ends while {name}", f"bin_end && state == {state} && !scan_start"
        yield f"scan begins while {name}", f"scan_start && state == {state}"


def loads(config: ClassifierConfig) -> Named:
    """Yield the points of first and last words of both weight memories."""
    for memory, words, chosen in (
        ("rows", config.weight_words, "!load_neurons"),
        ("neurons", config.neuron_words, "load_neurons"),
    ):
        for place, address in (("first", 0), ("last", words - 1)):
            yield f"{place} word of {memory} written", f"load_valid && {chosen} && load_address == {address}"


def _ends(config: ClassifierConfig) -> Named:
    """Yield the points of potentials at their limits and at the floor."""
    parts = [("hidden", config.membrane_bits, config.floor, config.saturates)]
    if config.readout == "spikes":
        parts += [("output", config.output_bits, config.out_floor, config.output_saturates)]
    for name, bits, floor, saturates in parts:
        value, valid = f"{name}_potential", f"{name}_valid"
        yield f"{name} neuron fires", f"{valid} && {name}_spike"
        yield f"{name} neuron does not fire", f"{valid} && !{name}_spike"
        if saturates:
            yield f"{name} potential at the top", f"{valid} && {value} == {highest(bits)}"
            if floor is None:
                yield f"{name} potential at the bottom", f"{valid} && {value} == {lowest(bits)}"
        if floor is not None:
            yield f"{name} potential at its floor", f"{valid} && {value} == {floor}"


def _classes(config: ClassifierConfig) -> Named:
    bits = config.evidence_bits
    for number in range(config.classes):
        yield f"class {number} found", f"class_valid && class_index == {number}"
    if config.classes > 1:
        first, second = (f"evidence[{number * bits} +: {bits}]" for number in (0, 1))
        yield "equal evidence: the first stays", f"class_valid && {first} == {second} && class_index == 0"
        yield "class changes", "class_valid && class_index != $past(class_index)"
    if config.readout == "spikes" and bits < 8:
        top = highest(bits)
        yield "evidence at the top", f"class_valid && $signed(evidence[0 +: {bits}]) == {top}"


def chip(config: ChipConfig) -> Iterator[Point]:
    """Return the coverage points of a chip."""
    return points_of(f"chip {config.readout.encoding}", "eskin_chip", table("chip"))
