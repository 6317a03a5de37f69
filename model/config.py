"""Configuration of the readout, shared by model, RTL, tests and networks."""

from __future__ import annotations

import json
import math
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Self, get_args

from eskin.base.configuration import Configuration, parameter
from eskin.base.errors import InputError
from eskin.base.files import read_json
from eskin.model.encoders import registry
from eskin.model.encoders.encoder import Encoder
from eskin.model.encoders.fields import KINDS, SETTABLE, Fields, parse
from eskin.model.links import registry as links
from eskin.model.links.link import Link as Protocol

Encoding = Literal["lcs", "cw-lcs", "nlcs", "nlcs-bipolar"]
"""Names of the encoders in ``eskin.model.encoders.registry``, repeated for the type checker."""
if get_args(Encoding) != registry.NAMES:
    raise TypeError(
        f"Encoding lists {get_args(Encoding)}, eskin.model.encoders.registry {registry.NAMES}; make them the same"
    )

Link = Literal["stream", "four_phase", "four_phase_dual"]
"""Names of the links in ``eskin.model.links.registry``, repeated for the type checker."""
if get_args(Link) != links.NAMES:
    raise TypeError(f"Link lists {get_args(Link)}, eskin.model.links.registry {links.NAMES}; make them the same")

Frontend = Literal["digital", "analog"]
Reset = Literal["sync", "async"]
DecideEvery = Literal["clock", "sample"]
Registers = Literal["none", "spi"]

MAX_SIDE = 64
"""Largest number of rows or columns: a row of requests fits one 64-bit word of the model."""

MAX_LEAK_PERIOD = 2**20
"""Largest number of sample ticks from one leak to the next."""

MIN_RATE_HZ, MAX_RATE_HZ = 1e-9, 1e12
"""Range of sample rates: from one sample in 30 years to a period below the delay of any gate."""

MAX_TAU_ERROR = 0.05
"""Largest relative error of a time constant that ``from_tau`` accepts."""


NO_LOGIC = ("sample_rate_hz", "clocks_per_sample")
"""Fields of ReadoutConfig that change constraints and time stamps, but no gate."""

SPECIFICATION = "docs/specification.md, section"


@dataclass(frozen=True, kw_only=True)
class ReadoutConfig(Configuration):
    """All parameters of one readout; immutable, validated, convertible to JSON.

    Parameters
    ----------
    rows, columns : int
        Taxel array, 1..64 each. Taxel (r, c) has index ``r * columns + c``.
    encoding : str
        Name of an encoder of ``eskin.model.encoders``.
    sample_bits : int
        W, bits of a signed sample; full scale +-1.0 is +-2**(W-1) codes.
    resolution : int
        N, 1..W-2. LSB = 2**-N of full scale; every encoder steps by half an LSB.
    decide_every : "clock" or "sample"
        A free taxel decides in every clock, or once per sample tick.
    reference_reset : int
        The reference after reset, in codes; a multiple of the closing step (a level of the encoder).
    closing_shift, window_period : int
        CW-LCS: the window closes by D / 2**closing_shift every window_period sample ticks without an event.
    leak_shift, leak_period, fraction_bits : int
        N-LCS: k, P and F of ``u <- u - ((u + 2**(k-1)) >> k)``, once per P sample ticks,
        with F fraction bits below the sample LSB.
    link : "stream", "four_phase" or "four_phase_dual"
        valid/ready stream; REQ/ACK with bundled address; or a REQ for ON and one for OFF, as INTUITIVE has.
    frontend : "digital" or "analog"
        Samples in, or comparator decisions in and thresholds (DAC codes) out.
    reset : "sync" or "async"
        Style of the flops' reset, active high.
    sample_rate_hz : float
        Sample ticks per second.
    clocks_per_sample : int
        Clocks per sample tick; the clock is ``sample_rate_hz * clocks_per_sample``.
    registers : "none" or "spi"
        Whether resolution, leak, window, mask and more can be set at run time, up to the built values.
    receptive_fields : "own", "neighbours", "both", "settable", or a list
        Receptive fields: samples that the encoder of a taxel sees (``model.encoders.fields``); settable with registers.

    Examples
    --------
    >>> config = ReadoutConfig(rows=12, columns=16, encoding="nlcs", resolution=8)
    >>> config.taxels, config.step, config.event_bits, round(config.tau_s, 3)
    (192, 4, 8, 0.2)
    >>> config.replace(encoding="lcs").has_polarity
    True
    >>> ReadoutConfig.from_json(config.to_json()) == config
    True
    >>> ReadoutConfig(resolution=11)
    Traceback (most recent call last):
    eskin.base.errors.InputError: resolution must be in 1..sample_bits - 2 = 10, not 11
    """

    rows: int = parameter(8, "", f"{SPECIFICATION} 1", "rows of taxels, 1..64")
    columns: int = parameter(8, "", f"{SPECIFICATION} 1", "columns of taxels, 1..64")
    encoding: Encoding = parameter(
        "lcs", "", f"{SPECIFICATION} 2", "level crossing, level crossing with closing window, or leaky neuron"
    )
    sample_bits: int = parameter(12, "", f"{SPECIFICATION} 2", "W, bits of a signed sample")
    resolution: int = parameter(6, "", f"{SPECIFICATION} 2", "N, LSB = 2**-N of full scale, 1..W-2")
    decide_every: DecideEvery = parameter(
        "clock",
        "",
        f"{SPECIFICATION} 2",
        "a taxel without a pending request decides in every clock, or once per sample",
    )
    reference_reset: int = parameter(0, "codes", f"{SPECIFICATION} 2", "reference after reset, in codes")
    closing_shift: int = parameter(2, "", f"{SPECIFICATION} 2", "cw-lcs: window closes by D / 2**shift")
    window_period: int = parameter(64, "", f"{SPECIFICATION} 2", "cw-lcs: sample ticks per closing step")
    leak_shift: int = parameter(6, "", f"{SPECIFICATION} 2", "nlcs: k of the leak")
    leak_period: int = parameter(63, "", f"{SPECIFICATION} 2", "nlcs: P, sample ticks per decay tick")
    fraction_bits: int = parameter(8, "", f"{SPECIFICATION} 2", "nlcs: F, bits of the reference below the sample LSB")
    link: Link = parameter("stream", "", f"{SPECIFICATION} 3", "valid/ready stream or REQ/ACK")
    frontend: Frontend = parameter(
        "digital", "", f"{SPECIFICATION} 4", "input: samples, or decisions of analog comparators"
    )
    reset: Reset = parameter("sync", "", f"{SPECIFICATION} 4", "reset style of the flops")
    sample_rate_hz: float = parameter(20_000.0, "Hz", f"{SPECIFICATION} 6", "sample ticks per second")
    clocks_per_sample: int = parameter(64, "", f"{SPECIFICATION} 4", "clocks per sample tick")
    registers: Registers = parameter("none", "", f"{SPECIFICATION} 4", "settings at run time: none, or over SPI")
    receptive_fields: Fields = parameter(
        "own",
        "",
        f"{SPECIFICATION} 2",
        "input of a taxel's encoder: its own sample, its neighbours', or both",
        values="|".join((*KINDS, SETTABLE, "JSON")),
    )

    def __post_init__(self) -> None:
        self._check_types(but=("receptive_fields",))
        self._check_array()
        object.__setattr__(self, "receptive_fields", parse(self.receptive_fields, self.taxels))
        self._check_range("sample_bits", 3, 24)
        self._check_range("resolution", 1, self.sample_bits - 2, "sample_bits - 2")
        self._check_range("closing_shift", 0, 16)
        self._check_range("window_period", 1, 2**16)
        self._check_range("leak_shift", 1, 16)
        self._check_range("leak_period", 1, MAX_LEAK_PERIOD)
        if self.frontend not in (known := self.encoder.frontends):
            raise InputError(f"encoding {self.encoding} needs frontend {' or '.join(known)}, not {self.frontend}")
        self.encoder.check(self)
        self._check_range("fraction_bits", 0, 28)
        self._check_range("clocks_per_sample", 1, 2**24)
        if not (math.isfinite(self.sample_rate_hz) and self.sample_rate_hz > 0):
            raise InputError(f"sample_rate_hz must be a positive number of hertz, not {self.sample_rate_hz!r}")
        if not MIN_RATE_HZ <= self.sample_rate_hz <= MAX_RATE_HZ:
            raise InputError(
                f"sample_rate_hz must be in {MIN_RATE_HZ:g}..{MAX_RATE_HZ:g} hertz, not {self.sample_rate_hz!r}"
            )
        # The reference is always on a level of the encoder.
        self._check_range("reference_reset", self.encoder.lowest(self), self.full_scale - 1)
        if self.reference_reset % self.grid:
            raise InputError(
                f"reference_reset must be a multiple of {self.grid} codes (a level of the encoder), "
                f"not {self.reference_reset}"
            )

        if self.receptive_fields == SETTABLE and self.registers == "none":
            raise InputError(
                "receptive_fields settable need registers in which a host chooses them; set registers to spi"
            )
        self.protocol.check(self)

    def _check_array(self) -> None:
        self._check_range("rows", 1, MAX_SIDE)
        self._check_range("columns", 1, MAX_SIDE)

    # -- derived numbers -------------------------------------------------------------------------

    @property
    def encoder(self) -> Encoder:
        """Encoder object of the configured encoding."""
        return registry.named(self.encoding)

    @property
    def protocol(self) -> Protocol:
        """Link object of the configured link."""
        return links.named(self.link)

    @property
    def idle_fields(self) -> tuple[str, ...]:
        """Names of the fields that the configured encoder ignores."""
        return tuple(n for one in registry.ENCODERS for n in one.parameters if n not in self.encoder.parameters)

    @property
    def taxels(self) -> int:
        """Number of taxels, rows * columns."""
        return self.rows * self.columns

    @property
    def full_scale(self) -> int:
        """Full scale 1.0 in codes, 2**(W-1)."""
        return 1 << (self.sample_bits - 1)

    @property
    def step(self) -> int:
        """D, half an LSB in codes: 2**(W-2-N)."""
        return 1 << (self.sample_bits - 2 - self.resolution)

    @property
    def decisions_per_tick(self) -> int:
        """Decisions of a taxel without a pending request between two samples."""
        return self.clocks_per_sample if self.decide_every == "clock" else 1

    @property
    def most_events_per_tick(self) -> int:
        """Largest number of events of a taxel in a tick."""
        return min(self.decisions_per_tick, 1 << (self.resolution + 2))

    @property
    def closing_levels_log2(self) -> int:
        """log2 of the number of half-widths of a CW-LCS window."""
        return min(self.closing_shift, self.sample_bits - 2 - self.resolution)

    @property
    def closing_step(self) -> int:
        """Codes by which a CW-LCS window closes per step, equal to its smallest half-width."""
        return self.step >> self.closing_levels_log2

    @property
    def grid(self) -> int:
        """Spacing of the reference levels in codes."""
        return self.encoder.grid(self)

    @property
    def has_polarity(self) -> bool:
        """True if events carry a polarity."""
        return self.encoder.polarity

    @property
    def closes(self) -> bool:
        """True if every taxel has a closing window with more than one half-width."""
        return self.encoder.closes(self)

    @property
    def asks_between_ticks(self) -> bool:
        """True if analog comparators are asked in other clocks than those of sample ticks, too."""
        return self.frontend == "analog" and self.decide_every == "clock"

    @property
    def half_width_bits(self) -> int:
        """Bits of the half-width of a window in codes."""
        return self.step.bit_length() if self.registers == "none" else self.sample_bits - 2

    @property
    def clock_hz(self) -> float:
        """Clock frequency in hertz."""
        return self.sample_rate_hz * self.clocks_per_sample

    @property
    def row_bits(self) -> int:
        """Bits of a row address; 0 for a one-row array."""
        return (self.rows - 1).bit_length()

    @property
    def column_bits(self) -> int:
        """Bits of a column address; 0 for a one-column array."""
        return (self.columns - 1).bit_length()

    @property
    def event_bits(self) -> int:
        """Bits of one address event {polarity, row, column}."""
        return int(self.has_polarity) + self.row_bits + self.column_bits

    @property
    def address_bits(self) -> int:
        """Address bits beside the request lines of a four-phase link."""
        return self.event_bits - self.protocol.request_has_polarity

    @property
    def tau_s(self) -> float:
        """Time constant in seconds for leak_shift k and leak_period P: -P Ts / ln(1 - 2**-k)."""
        return -self.leak_period / self.sample_rate_hz / math.log1p(-(2.0**-self.leak_shift))

    # -- construction and exchange ---------------------------------------------------------------

    @classmethod
    def from_tau(cls, tau_s: float, ts_s: float, encoding: Encoding = "nlcs", **parameters: Any) -> ReadoutConfig:
        """Return the configuration of a leaky encoder whose leak is closest to a time constant.

        A coarse leak (small leak_shift) removes events, by about a quarter of its step, and a short period approximates
        tau badly. The method takes the leak_shift from 1 to 6 with the smallest sum of both errors. ``tau_s`` of the
        result is the exact time constant of its integers. If none comes within 5 % of ``tau_s``, the error names the
        nearest time constants that do.

        - ``tau_s``, ``ts_s``: wanted time constant and sample period in seconds.
        - ``parameters``: all other fields of the configuration but sample_rate_hz, leak_shift and leak_period.
        """
        for name, value in (("tau", tau_s), ("sample period", ts_s)):
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"{name} must be a positive number of seconds, not {value!r}")
        candidates, below, above = [], [], []
        for shift in range(1, 7):
            unit_s = -ts_s / math.log1p(-(2.0**-shift))  # time constant of leak_period 1
            ticks = min(tau_s / unit_s, 2.0**21)
            period = min(round(ticks), MAX_LEAK_PERIOD)
            if period and (error := abs(period / ticks - 1)) <= MAX_TAU_ERROR:
                candidates.append((error + 0.25 * 2**-shift, shift, period))
            if ticks >= 1:
                below.append(min(math.floor(ticks), MAX_LEAK_PERIOD) * unit_s)
            if ticks <= MAX_LEAK_PERIOD:
                above.append(max(math.ceil(ticks), 1) * unit_s)
        if not candidates:
            nearest = " or ".join(f"{near_s:.3g}" for near_s in [*sorted(below)[-1:], *sorted(above)[:1]])
            raise InputError(
                f"tau {tau_s:g} s is not reachable with a sample period of {ts_s:g} s; the nearest is {nearest} s"
            )
        _, shift, period = min(candidates)
        return cls(encoding=encoding, sample_rate_hz=1 / ts_s, leak_shift=shift, leak_period=period, **parameters)

    def lookup(self, field: str, **values: Any) -> Any:
        """Return the entry of a table for the value of a field; raise InputError if the table has no entry."""
        if (value := getattr(self, field)) not in values:
            raise InputError(f"{field} {value!r} is unknown here; known values are {', '.join(values)}")
        return values[value]

    def to_dict(self) -> dict[str, Any]:
        """Return all fields as a dictionary, without unused registers and receptive fields."""
        fields = super().to_dict()
        if self.registers == "none":
            del fields["registers"]
        if self.receptive_fields == "own":
            del fields["receptive_fields"]
        elif not isinstance(self.receptive_fields, str):
            fields["receptive_fields"] = [one.to_dict() for one in self.receptive_fields]
        return fields

    @classmethod
    def from_dict(cls, fields: Any) -> Self:
        """Return the configuration for a dictionary; raise an error for unknown fields."""
        if isinstance(fields, dict) and "fields" in fields:  # name of ``receptive_fields`` in older files
            fields = {"receptive_fields" if name == "fields" else name: value for name, value in fields.items()}
        return super().from_dict(fields)

    @classmethod
    def from_json(cls, text: str) -> Self:
        """Return the configuration for JSON text."""
        try:
            fields = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise InputError(f"the configuration is not JSON: {error}") from None
        return cls.from_dict(fields)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Return the configuration from a JSON file: a configuration file, or the description beside the Verilog."""
        return cls.of_file(Path(path))[0]

    @classmethod
    def of_file(cls, path: Path, beside: Collection[str] = ()) -> tuple[Self, dict[str, Any]]:
        """Return the configuration from a JSON file, and a dictionary of all fields in the file.

        The file may also have fields of another configuration, which ``beside`` lists.
        """
        content = read_json(path, "the configuration", dict)
        fields = content["configuration"] if {"configuration", "ports"} <= set(content) else content
        try:
            own = {name: value for name, value in fields.items() if name not in beside} if beside else fields
            return cls.from_dict(own), fields
        except InputError as error:
            raise InputError(f"the configuration {path}: {error}") from None
