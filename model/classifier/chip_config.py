"""Configuration of a chip: a spiking readout whose arbiter feeds a classifier."""

from __future__ import annotations

from dataclasses import dataclass
from operator import attrgetter
from typing import Any

from eskin.base.configuration import Configuration
from eskin.base.errors import InputError
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.classifier.run import work_clocks
from eskin.model.config import ReadoutConfig

PREFIX = "classifier_"


def with_room(readout: ReadoutConfig, classifier: ClassifierConfig) -> ReadoutConfig:
    """Return a readout configuration with enough clocks per sample for the classifier to finish its work in every bin.

    That is an event of every channel, and a spike of every hidden neuron in the bin and in the one before. The clocks
    are doubled until they suffice, so samples and events stay in their bins.
    """
    needed = work_clocks(classifier, 1, 1) + classifier.groups * classifier.inputs
    while round(classifier.bin_s * readout.clock_hz) < needed:
        readout = readout.replace(clocks_per_sample=2 * readout.clocks_per_sample)
    return readout


@dataclass(frozen=True, kw_only=True)
class ChipConfig(Configuration):
    """The configurations of a readout and a classifier that fit together.

    The readout has the stream link. The classifier has one input per taxel, or two with separate ON and OFF. Reset and
    clock are those of the readout: the clocks of a time bin follow from them and the bin's seconds. Configurations that
    do not fit raise InputError.
    """

    readout: ReadoutConfig
    classifier: ClassifierConfig

    def __post_init__(self) -> None:
        self._check_types()
        readout, classifier = self.readout, self.classifier
        if not readout.protocol.streams:
            raise InputError(f"the readout of a chip must have the link stream, not {readout.link}")
        if classifier.inputs not in self._channels():
            taken = " or ".join(map(str, self._channels()))
            raise InputError(
                f"the classifier has {classifier.inputs} input channels, but {readout.rows} x {readout.columns} "
                f"taxels of {readout.encoding} have {taken}; give the readout of its training"
            )
        clocks = round(classifier.bin_s * readout.clock_hz)
        least = work_clocks(classifier, 0, 0)
        if clocks < least:
            raise InputError(
                f"a bin of {classifier.bin_s:g} s has {clocks} clocks, but its work needs {least}; "
                f"raise --clocks-per-sample"
            )
        object.__setattr__(self, "classifier", classifier.replace(clocks_per_bin=clocks, reset=readout.reset))

    def _channels(self) -> tuple[int, ...]:
        taxels = self.readout.taxels
        return (taxels, 2 * taxels) if self.readout.has_polarity else (taxels,)

    @property
    def polarity(self) -> bool:
        """True if OFF events have input channels of their own."""
        return self.classifier.inputs > self.readout.taxels

    reset = property(attrgetter("readout.reset"), doc="Reset style of the flip-flops.")
    clock_hz = property(attrgetter("readout.clock_hz"), doc="Clock frequency in hertz.")

    def to_dict(self) -> dict[str, Any]:
        """Return all fields as one flat dictionary; a prefix marks the fields of the classifier."""
        own = {f"{PREFIX}{name}": value for name, value in self.classifier.to_dict().items()}
        return self.readout.to_dict() | own

    @classmethod
    def from_dict(cls, fields: dict[str, Any]) -> ChipConfig:
        """Return the chip configuration for a dictionary written by ``to_dict``."""
        own = {name.removeprefix(PREFIX): value for name, value in fields.items() if name.startswith(PREFIX)}
        readout = {name: value for name, value in fields.items() if not name.startswith(PREFIX)}
        return cls(readout=ReadoutConfig.from_dict(readout), classifier=ClassifierConfig.from_dict(own))
