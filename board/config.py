"""Configuration of a board: design and serial line (docs/reference/board.md)."""

import json
import zlib
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Literal

from eskin.base.configuration import Configuration
from eskin.base.errors import InputError
from eskin.board.sensor import SensorConfig
from eskin.model.classifier.chip_config import ChipConfig

Design = Literal["player", "receiver"]

DESIGNS: tuple[Design, ...] = ("player", "receiver")
"""Designs by their numbers, from 1 on: a chip that gets samples, or a receiver for a foreign chip."""

ADDRESS_BITS = 12  # bits of the address in an event record, including polarity

OFF_FLAG = 1 << ADDRESS_BITS - 1
"""Bit of the address that a request of OFF sets; the chip's own address is below both flags."""

BOTH_FLAG = OFF_FLAG >> 1  # bit of the address that two simultaneous requests set; no chip should send them
LEAST_CLOCKS = 4  # clocks of a bit on the serial line
MAX_CLASSES = 64
MAX_WORDS = 1 << 16


@dataclass(frozen=True, kw_only=True)
class SerialConfig(Configuration):
    """Parameters of the serial line: 8 bits, no parity, one stop bit."""

    clock_hz: int = 50_000_000  # clock of the board
    baud: int = 2_000_000  # at most a quarter of the clock, which need not be a multiple
    buffer_bytes: int = 4096  # for frames that the board has not executed yet, a power of two
    idle_bits: int = 1 << 18  # bit times without a byte after which a frame counts as lost
    records: int = 1024  # largest number of words that wait for the line, a power of two

    def __post_init__(self) -> None:
        self._check_types()
        if self.baud < 1:
            raise InputError(f"baud of the serial line must be at least 1, not {self.baud}")
        if self.clocks_per_bit < LEAST_CLOCKS:
            raise InputError(
                f"baud of the serial line must be at most clock_hz / {LEAST_CLOCKS} = {self.clock_hz // LEAST_CLOCKS}, "
                f"not {self.baud}"
            )

    @property
    def clocks_per_bit(self) -> Fraction:
        """Clocks of a bit."""
        return Fraction(self.clock_hz, self.baud)


@dataclass(frozen=True, kw_only=True)
class BoardConfig(Configuration):
    """All parameters of the design in the FPGA of a board.

    Raises InputError if the chip takes no samples, or has more classes or addresses than a record holds.
    """

    chip: ChipConfig | None  # readout (digital front end) and classifier of a player; none for an AER receiver
    serial: SerialConfig = field(default_factory=SerialConfig)
    sensor: SensorConfig | None = None  # a skin at the pins of a player: its samples need no host

    def __post_init__(self) -> None:
        self._check_types()
        if self.chip is None:
            if self.sensor is not None:
                raise InputError("a receiver has no converter; build a player for a skin at the board")
            return
        if self.sensor is not None:
            self.sensor.check(self.chip.readout, self.serial.clock_hz)
        readout = self.chip.readout
        if readout.frontend != "digital" or readout.registers != "none" or readout.reset != "sync":
            raise InputError(
                f"a board takes samples: frontend digital, no registers, reset sync, not {readout.frontend}, "
                f"{readout.registers}, {readout.reset}"
            )
        classifier = self.chip.classifier
        if classifier.channel_bits > ADDRESS_BITS:
            raise InputError(f"a board has at most {1 << ADDRESS_BITS} channels, not {classifier.inputs}")
        if readout.sample_bits > 16:
            raise InputError(f"a board takes samples of at most 16 bits, not {readout.sample_bits}")
        if max(classifier.weight_words, classifier.neuron_words) > MAX_WORDS:
            raise InputError(f"a board loads at most {MAX_WORDS} words of weights, not {classifier.weight_words}")
        if classifier.classes > MAX_CLASSES:
            raise InputError(f"a board has at most {MAX_CLASSES} classes, not {classifier.classes}")

    @property
    def design(self) -> Design:
        """Kind of the design: player or receiver."""
        return "receiver" if self.chip is None else "player"

    @property
    def word_bytes(self) -> int:
        """Bytes per memory word of weights; 0 without a classifier."""
        if self.chip is None:
            return 0
        classifier = self.chip.classifier
        return -(-max(classifier.lanes * classifier.weight_bits, classifier.neuron_bits) // 8)

    @property
    def identity(self) -> int:
        """32-bit number that identifies the design to the host.

        It stands for the chip with all its constants (thresholds, shifts, widths), but not for weights, which are
        loaded, and not for what only names a unit of time (sampling rate, seconds of a bin).
        """
        fields = {} if self.chip is None else self.chip.to_dict()
        fields = {name: value for name, value in fields.items() if name not in UNITS}
        return zlib.crc32(json.dumps([self.design, fields], sort_keys=True).encode())


UNITS = ("sample_rate_hz", "classifier_bin_s")
"""Fields without effect on the hardware, which counts clocks per sample and per bin."""
