"""Blocks and configurations to prove."""

from dataclasses import dataclass
from typing import Any

from eskin.model.bus.config import BusConfig
from eskin.model.cases import CHOICES, axes, cases, pairs
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import FrameConfig
from eskin.model.tiles.config import TilesConfig
from eskin.verify.proofs.blocks.arbiter import ArbiterChecker
from eskin.verify.proofs.blocks.classifier import ScheduleChecker, SumsChecker
from eskin.verify.proofs.blocks.decay import DecayChecker, SettableDecayChecker
from eskin.verify.proofs.blocks.fields import FieldsChecker
from eskin.verify.proofs.blocks.frame import FrameChecker
from eskin.verify.proofs.blocks.link import AxiStreamChecker, LinkChecker
from eskin.verify.proofs.blocks.merge import MergeChecker, RelayChecker
from eskin.verify.proofs.blocks.pattern import PatternChecker
from eskin.verify.proofs.blocks.readout import ReadoutChecker
from eskin.verify.proofs.blocks.registers import (
    BusHostChecker,
    RegistersChecker,
    ShortHostChecker,
    ShortRegistersChecker,
)
from eskin.verify.proofs.blocks.spi import AxiLiteChecker, NarrowSpiChecker
from eskin.verify.proofs.blocks.taxel import TaxelChecker
from eskin.verify.proofs.blocks.window import WindowChecker
from eskin.verify.proofs.checker import Checker


@dataclass(frozen=True)
class Proof:
    """One block in one configuration."""

    checker: type[Checker[Any]]  # block and properties
    config: Any
    depth: int  # clocks of the search for failures and covered cases
    small: bool = False  # part of the gate
    hunts: bool = False  # whether mutants are generated and tested

    @property
    def block(self) -> str:
        """Name of the block."""
        return self.checker.block.module_name.removeprefix("eskin_")

    @property
    def size(self) -> str:
        """Distinctive parameters of the configuration, for tables."""
        c = self.config
        array = f"{c.rows} x {c.columns}" if hasattr(c, "rows") else ""
        tick = " by the tick" * (getattr(c, "decide_every", "") == "sample")
        fields = " fields" * (getattr(c, "receptive_fields", "own") != "own")
        match self.block:
            case "arbiter" | "link":
                return array + " unipolar" * (not c.has_polarity)
            case "axi_stream":
                return f"{c.readout.event_bits} bits, {c.time_bits} of time"
            case "merge":
                return f"{c.tiles} tiles, {c.tile.event_bits} bits"
            case "relay":
                return f"{c.tile.event_bits} bits"
            case "frame_readout":
                return f"{array}, {c.resolution} in {c.word_bits} bits"
            case "spi" | "axi_lite":
                return f"words of {self.checker.block.word_bits} bits"
            case "registers" | "pattern":
                return f"{array} {c.encoding}{', counters of 3 bits' * (self.checker is ShortRegistersChecker)}"
            case "host":
                behind = " behind SPI" if self.checker.cut else ", words of 3 bits at the pins"
                return f"{array} {c.encoding} {c.frontend}{fields}{behind}"
            case "decay":
                return f"{c.rows} rows, {c.leak_period} ticks{' at most' * (c.registers != 'none')}"
            case "classifier":
                ends = ", saturates" * c.saturates + ", currents" * bool(c.synapse_shift)
                ends += ", own parameters" * c.own_parameters + ", delayed" * (c.neuron_reset == "delayed")
                ends += f", {len(c.stack)} layers" * bool(c.layers) + f", margin {c.margin}" * bool(c.margin)
                return f"{c.inputs}-{c.hidden}-{c.classes}, {c.lanes} lanes, {c.readout}{ends}"
            case "fields":
                return f"{array} {c.receptive_fields if isinstance(c.receptive_fields, str) else 'lists'}"
            case "readout":
                return f"{array} {c.encoding} {c.frontend} {c.link}{tick}{fields}"
        return f"{c.encoding} {c.frontend} {c.sample_bits} bits{tick}{' registers' * (c.registers != 'none')}"


SMALL = ReadoutConfig(sample_bits=6, resolution=2, window_period=2, leak_shift=2, fraction_bits=2)
"""Few bits, so that proofs reach the ends of the scale and the maximum of every counter."""

HOSTED = SMALL.replace(rows=1, registers="spi")

NEAR_THE_END = ReadoutConfig(reference_reset=2048 - 2 * 16)
"""The default widths, with a reference that starts two steps below the top."""


HUNTED = {
    ("lcs", "digital", "clock"),
    ("cw-lcs", "analog", "clock"),
    ("nlcs", "analog", "clock"),
    ("nlcs", "digital", "sample"),
}
"""Encoders, front ends and decision rates of the taxels whose mutants are tested: every property applies to one."""


def arbiters() -> list[Proof]:
    """Return the proofs of the arbiter, with depths that reach the bound on waiting."""
    sizes = [
        (1, 1, "lcs"),
        (2, 2, "lcs"),
        (1, 4, "lcs"),
        (4, 1, "lcs"),
        (5, 1, "lcs"),
        (9, 1, "lcs"),
        (3, 5, "lcs"),
        (3, 5, "nlcs"),
    ]
    configs = [ReadoutConfig(rows=rows, columns=columns, encoding=encoding) for rows, columns, encoding in sizes]  # type: ignore[arg-type]
    return [
        Proof(ArbiterChecker, c, (c.rows + 1) * c.columns + 2, c.rows == c.columns == 2, c.rows == c.columns == 2)
        for c in configs
    ]


def links() -> list[Proof]:
    """Return the proofs of the link with different address widths."""
    configs = [
        ReadoutConfig(rows=1, columns=1, encoding="nlcs", link="four_phase"),
        ReadoutConfig(rows=2, columns=2, link="four_phase"),
        ReadoutConfig(rows=1, columns=1, link="four_phase_dual"),
        ReadoutConfig(rows=2, columns=2, link="four_phase_dual"),
        ReadoutConfig(rows=3, columns=5, link="four_phase"),
    ]
    return [Proof(LinkChecker, c, 16, c.rows == 2, c.rows == 2) for c in configs]


def buses() -> list[Proof]:
    """Return the proofs of the AXI wrapper with different fields of an event."""
    few = BusConfig(readout=ReadoutConfig(rows=2, columns=3, registers="spi"), time_bits=2)
    line = few.replace(readout=few.readout.replace(rows=1, encoding="nlcs"), time_bits=0)
    sizes = (few, line, line.replace(readout=line.readout.replace(columns=1)))
    return [
        *(Proof(AxiStreamChecker, c, 10, c == few, c == few) for c in sizes),
        Proof(AxiLiteChecker, few.readout, 72, True, True),
    ]


def taxels() -> list[Proof]:
    """Return the proofs of taxel and window: both front ends and decision rates, several bit widths."""
    kinds = axes("encoding", "frontend")
    windows = list(cases(SMALL.replace(encoding="cw-lcs", sample_bits=8), **axes("frontend")))
    hosted = [window.replace(registers="spi", window_period=3) for window in windows]
    few = list(cases(SMALL, decide_every=CHOICES["decide_every"], **kinds))
    by_host = [c.replace(resolution=3 if c.encoding == "lcs" else 2) for c in cases(HOSTED, **kinds)]
    wide = cases(NEAR_THE_END, **kinds)
    return [
        *(Proof(WindowChecker, c, 12, hunts=True) for c in windows),
        *(Proof(WindowChecker, c, 12, c == hosted[0]) for c in hosted),
        *(
            Proof(
                TaxelChecker,
                c,
                14,
                c.has_polarity and (c.frontend, c.decide_every) == ("digital", "clock"),
                (c.encoding, c.frontend, c.decide_every) in HUNTED,
            )
            for c in few
        ),
        *(Proof(TaxelChecker, c, 14) for c in by_host),
        *(Proof(TaxelChecker, c, 6) for c in wide),
    ]


def readouts() -> list[Proof]:
    """Return the proofs of whole small readouts: both sizes of arrays with every link, and all pairs of settings."""
    few = ReadoutConfig(frontend="analog", sample_bits=4, resolution=2)
    sides = ({"rows": 1, "columns": 1}, {"rows": 2, "columns": 2})
    spiking = list(cases(few, array=sides, **axes("link")))
    tight = SMALL.replace(rows=2, columns=2, sample_bits=4, fraction_bits=1)
    coded = pairs(
        tight, **axes("encoding", "frontend", "link", "reset", "decide_every"), receptive_fields=("own", "both")
    )
    spiking += [c.replace(sample_bits=6) if c.encoder.windowed else c for c in coded]

    def hunts(c: ReadoutConfig) -> bool:
        return c.frontend == "analog" and not c.encoder.leaks and (c.rows, c.link) in {(1, "four_phase"), (2, "stream")}

    # Codes of a word's size, of half a word, and such as do not fit it.
    shapes = [(1, 1, 2, 2), (1, 1, 3, 4), (2, 2, 2, 4), (2, 2, 3, 8), (1, 3, 1, 2)]
    frames = [
        FrameConfig(
            readout=ReadoutConfig(rows=rows, columns=columns, sample_bits=bits + 2, resolution=bits),
            word_bits=word,
            settle_clocks=3 if word == 8 else 1,
        )
        for rows, columns, bits, word in shapes
    ]
    return [
        *(Proof(FrameChecker, c, 36 if c.word_bits == 8 else 24, c == frames[0], c in frames[1:4]) for c in frames),
        *(Proof(ReadoutChecker, c, 12, c == spiking[0], hunts(c)) for c in spiking),
    ]


def hosts() -> list[Proof]:
    """Return the proofs of the host interface."""
    base = ReadoutConfig(registers="spi")
    few = base.replace(rows=2, columns=2, encoding="nlcs", sample_bits=8, resolution=3, leak_period=5)
    more = base.replace(rows=5, columns=8, encoding="cw-lcs", window_period=5)
    window = base.replace(rows=1, columns=2, encoding="cw-lcs", sample_bits=8, resolution=3, window_period=3)
    chosen = list(cases(window.replace(rows=2, receptive_fields="settable"), **axes("frontend")))
    patterns = [base.replace(rows=2, columns=2), base.replace(rows=1, columns=4), base.replace(rows=4, columns=1)]
    return [
        Proof(NarrowSpiChecker, few, 27, True, True),
        Proof(ShortRegistersChecker, few, 12, True),
        *(Proof(RegistersChecker, c, 8, False, True) for c in (few, more)),
        *(Proof(PatternChecker, c, 14, c.rows == 2, c.rows == 2) for c in patterns),
        *(Proof(BusHostChecker, c, 8, c == few, c in (few, chosen[-1])) for c in (few, *chosen)),
        Proof(ShortHostChecker, window, 30),
    ]


def leaks() -> list[Proof]:
    """Return the proofs of the decay ticks, with fixed and settable periods."""
    base = ReadoutConfig(columns=1, encoding="nlcs")
    built = [base.replace(rows=rows, leak_period=period) for rows, period in ((1, 3), (3, 2), (3, 5))]
    given = [base.replace(rows=rows, leak_period=period, registers="spi") for rows, period in ((1, 3), (3, 5))]
    return [
        *(Proof(DecayChecker, c, 14, c == built[2]) for c in built),
        *(Proof(SettableDecayChecker, c, 14, hunts=c == given[1]) for c in given),
    ]


def merges() -> list[Proof]:
    """Return the proofs of the merge with different numbers of tiles and address widths."""
    few = ReadoutConfig(rows=2, columns=2)
    bare = ReadoutConfig(rows=1, columns=1, encoding="nlcs")
    sizes = [(few, 1, 1), (few, 1, 2), (bare, 1, 2), (few, 3, 1), (bare, 1, 5), (few, 2, 2)]
    configs = [TilesConfig.of(tile, rows, columns) for tile, rows, columns in sizes]
    return [Proof(MergeChecker, c, c.tiles + 8, c == configs[1], c == configs[3]) for c in configs]


def relays() -> list[Proof]:
    """Return the proofs of the relay station with different payload widths."""
    tiles = [
        ReadoutConfig(rows=1, columns=1, encoding="nlcs"),
        ReadoutConfig(rows=2, columns=2),
        ReadoutConfig(rows=64, columns=64),
    ]
    return [Proof(RelayChecker, TilesConfig.of(t, 1, 1, 1), 8, t.rows == 2, t.rows == 2) for t in tiles]


def classifiers() -> list[Proof]:
    """Return the proofs of the classifier: small networks with each kind of neuron, stacks, and an early decision."""
    fields = dict.fromkeys(("inputs", "hidden", "classes", "lanes", "threshold", "out_threshold"), 1)
    fields |= dict.fromkeys(("in_bits", "rec_bits", "out_bits", "bias_bits", "clocks_per_bin"), 2)
    fields |= {"membrane_bits": 5, "output_bits": 4, "evidence_bits": 4, "floor": 0, "out_floor": 0}
    few = ClassifierConfig.from_dict(fields)
    more = few.replace(inputs=2, hidden=2, classes=2, lanes=2)
    leaky = {"readout": "membrane", "neuron_reset": "subtract", "leak_shift": 1, "out_leak_shift": 1, "floor": None}
    other = more.replace(**leaky, lanes=1, clocks_per_bin=4, in_shift=1, membrane_bits=8, output_bits=6)
    leaks = {"leak_shift": 2, "leak_factor": 3, "synapse_shift": 1, "out_leak_shift": 1, "out_synapse_shift": 1}
    synaptic = few.replace(**leaks)
    own = few.replace(own_parameters=True, classes=2, out_threshold=2, membrane_bits=6)
    delayed = few.replace(neuron_reset="delayed", own_parameters=True)
    leaking = {"neuron_reset": "delayed", "leak_shift": 1, "out_leak_shift": 1, "floor": None, "out_floor": None}
    stack = few.replace(hidden=2, lanes=2, layers=((0, 1, (0,)), (1, 2, (0, 1))))
    synaptic_stack = stack.replace(**leaks, lanes=1, layers=((0, 1, ()), (1, 2, (0,))))
    sure = few.replace(classes=3, readout="membrane", out_leak_shift=1, margin=2)
    coarse = {"in_bits": 4, "in_shift": 1, "out_bits": 4, "out_shift": 1}  # a weight has more bits than a potential
    return [
        Proof(ScheduleChecker, few, 32, True, True),  # an event may wait 25 clocks
        *(Proof(ScheduleChecker, config, 24) for config in (more, other)),
        Proof(ScheduleChecker, more.replace(hidden=4, lanes=1, layers=((0, 2, ()), (2, 4, (0, 1)))), 44),
        Proof(SumsChecker, few, 16, True, True),
        Proof(SumsChecker, few.replace(classes=2), 18, False, True),
        Proof(SumsChecker, few.replace(clocks_per_bin=8, membrane_bits=4), 16),
        Proof(SumsChecker, synaptic, 20),
        Proof(SumsChecker, synaptic.replace(**coarse, clocks_per_bin=8, membrane_bits=4, readout="membrane"), 16),
        Proof(SumsChecker, own, 20),
        Proof(SumsChecker, own.replace(neuron_reset="subtract", hidden=2, classes=1), 20),
        Proof(SumsChecker, delayed, 20),
        Proof(SumsChecker, few.replace(**leaking, membrane_bits=7, output_bits=6), 18),
        Proof(ScheduleChecker, stack, 36),
        Proof(SumsChecker, stack, 30, False, True),
        Proof(ScheduleChecker, synaptic_stack, 36),
        Proof(SumsChecker, synaptic_stack, 28, False, True),
        Proof(SumsChecker, sure, 20, False, True),
        Proof(SumsChecker, few.replace(hidden=2, lanes=2), 18),
        Proof(SumsChecker, few.replace(hidden=3, lanes=2), 26),
    ]


def fields() -> list[Proof]:
    """Return the proofs of the receptive fields: named, chosen by a host, and listed."""
    listed: Any = ([[0, 1, 2, 3], 1], [[1], 0], [[0, 0, 3], 2], [[], 0])
    few = SMALL.replace(rows=2, columns=2, sample_bits=4, receptive_fields=listed)
    named = cases(
        SMALL.replace(rows=2, columns=2, sample_bits=3, resolution=1), receptive_fields=("neighbours", "both")
    )
    chosen = SMALL.replace(rows=1, columns=2, sample_bits=3, resolution=1, receptive_fields="settable", registers="spi")
    return [Proof(FieldsChecker, c, 2, c == few, c == few) for c in (few, *named, chosen)]


def proofs() -> list[Proof]:
    """Return all proofs in order of execution."""
    return [
        *(*arbiters(), *links(), *buses(), *merges(), *relays(), *leaks(), *fields(), *taxels(), *readouts(), *hosts()),
        *classifiers(),
    ]
