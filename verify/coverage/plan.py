"""Coverage plan: designs that together contain every block, encoder, front end and link."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eskin.board.config import BoardConfig
from eskin.cocotb_tests.blocks import merge, pattern, registers, skin, spi
from eskin.model.bus.config import BusConfig
from eskin.model.cases import LISTED, axes, cases, pairs, values_of
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.config import ReadoutConfig
from eskin.model.encoders.fields import KINDS, SETTABLE
from eskin.model.frame_config import FrameConfig
from eskin.model.tiles.config import MergeConfig, TilesConfig
from eskin.rtl.verilog import Config
from eskin.verify.coverage import stimuli
from eskin.verify.coverage.boards.play import board, small_board


@dataclass(frozen=True)
class Run:
    """A design and its stimuli."""

    name: str
    config: Config | BoardConfig
    player: Callable[[Any, Path], object]  # simulates a configuration in a folder, and compares it with a model
    small: bool = False  # part of the gate
    # modules whose constructs count; all modules if empty
    only: tuple[str, ...] = ()


SMALL = ReadoutConfig(rows=3, columns=3, sample_bits=6, resolution=3, leak_shift=3, leak_period=4, fraction_bits=2)
SMALL = SMALL.replace(closing_shift=1, window_period=3)
"""Readout with few bits and three rows and columns, so that runs reach every limit."""

ARRAYS = tuple({"rows": rows, "columns": columns} for rows, columns in ((3, 3), (2, 2), (5, 2), (9, 2)))

LEFT_OUT = {
    ("receptive_fields", LISTED): "a taxel that is off has constant nets; the simulated readouts have lists",
    ("rows", "1"): "the points of the arbiter need two rows; the simulated readouts have arrays of one row",
}
"""Values without a run, and the reason."""


def runs() -> list[Run]:
    """Return all coverage runs."""
    return [*_readouts(), *_frames(), *_hosts(), *_skins(), *_classifiers(), *_boards(), *_buses()]


def _readouts() -> Iterator[Run]:
    """Yield two runs for the gate, and runs in which any two settings of a readout meet."""
    yield Run("plain", SMALL, stimuli.readout, small=True)
    yield Run("windows", SMALL.replace(encoding="cw-lcs"), stimuli.readout, small=True)
    settings = axes("encoding", "frontend", "link", "reset", "decide_every")
    for config in pairs(SMALL, **settings, receptive_fields=KINDS, array=ARRAYS)[1:]:
        yield Run(" ".join(values_of(config).values()), config, stimuli.readout)


def _frames() -> Iterator[Run]:
    for rows, columns, resolution, word_bits, own in (
        (3, 5, 5, 12, {}),
        (3, 2, 6, 6, {"reset": "async"}),
        (1, 3, 6, 16, {"reset": "async"}),
        (1, 3, 4, 8, {"settle_clocks": 3}),
    ):
        fields = {"rows": rows, "columns": columns, "resolution": resolution, "word_bits": word_bits, "sample_bits": 8}
        config = FrameConfig.from_dict(fields | own)
        name = f"frames {rows}x{columns}, {resolution} in {word_bits} bits"
        yield Run(name, config, stimuli.frame, small=word_bits == 12)


def _hosts() -> Iterator[Run]:
    """Yield runs of readouts with registers, and of the blocks of the host interface."""
    base = SMALL.replace(registers="spi")
    for config in pairs(base, **axes("encoding", "frontend", "reset"), receptive_fields=("own", SETTABLE)):
        yield Run(f"registers {' '.join(values_of(config).values())}", config, stimuli.host)
    for name, steps, configs in (
        ("registers", registers.steps, cases(base, **axes("encoding"), receptive_fields=("own", SETTABLE))),
        ("pattern", pattern.steps, cases(base, **axes("encoding"))),
        ("spi", spi.steps, cases(base, **axes("reset"))),
    ):
        for config in configs:
            own = f"{name} alone {config.encoding} {config.receptive_fields} {config.reset}"
            yield Run(own, config, stimuli.alone(f"eskin_{name}", steps, 11, 12, 13))


def _skins() -> Iterator[Run]:
    """Yield runs of skins with and without relay stations, and of merge and relay station alone."""
    merges, relays = (stimuli.alone("eskin_merge", merge.steps, 3), stimuli.alone("eskin_relay", merge.relay_steps, 5))
    skins = stimuli.alone("eskin_tiles", skin.steps, 0)
    for down, across, encoding, reset in ((2, 2, "lcs", "sync"), (1, 3, "nlcs", "async")):
        tile = SMALL.replace(rows=2, columns=2, encoding=encoding)
        config = TilesConfig.of(tile, down, across)
        yield Run(f"merge {config.tiles} tiles {encoding}", MergeConfig(config), merges)
        yield Run(f"skin {config.tiles} tiles {encoding}", config, skins, only=("eskin_merge",))
        lines = TilesConfig.of(tile.replace(reset=reset), down, across, relays=2)
        yield Run(f"relay {encoding}", lines, relays)
        yield Run(f"skin {config.tiles} tiles {encoding}, relays", lines, skins, only=("eskin_relay",))


def _classifiers() -> Iterator[Run]:
    """Yield runs of classifiers with saturation, leak and floor, and of chips with a classifier."""
    base = {"inputs": 12, "hidden": 4, "lanes": 2, "clocks_per_bin": 64 * 4, "threshold": 300, "out_threshold": 200}
    base |= {"membrane_bits": 10, "output_bits": 9, "evidence_bits": 4}
    variants: dict[str, dict[str, Any]] = {
        "plain": {"classes": 3, "floor": -300, "out_floor": -200},
        "saturating": {"classes": 3, "in_shift": 3, "rec_shift": 6, "out_shift": 4, "lanes": 2},
        "leaky": {"classes": 2, "neuron_reset": "subtract", "leak_shift": 3, "out_leak_shift": 2, "floor": -50}
        | {"reset": "async", "lanes": 1, "threshold": 450},
        "own parameters": {"classes": 4, "own_parameters": True, "neuron_reset": "subtract", "floor": -300}
        | {"out_threshold": 300, "output_bits": 10, "out_shift": 1, "margin": 3},
        "layers": {"classes": 3, "hidden": 4, "lanes": 1, "layers": [[0, 2, []], [2, 4, [0, 1]]]}
        | {"neuron_reset": "delayed", "leak_shift": 2, "threshold": 150, "out_threshold": 60},
        "currents": {"classes": 3, "synapse_shift": 2, "out_synapse_shift": 1, "leak_shift": 2, "out_leak_shift": 2},
        "membrane": {"classes": 4, "readout": "membrane", "out_leak_shift": 4, "leak_shift": 1, "evidence_bits": 11},
    }
    for name, own in variants.items():
        config = ClassifierConfig.from_dict(base | own)
        yield Run(f"classifier {name}", config, stimuli.classifier)
    for encoding, channels in (("lcs", 18), ("nlcs", 9)):
        readout = SMALL.replace(encoding=encoding, sample_bits=8, resolution=5, clocks_per_sample=64)
        own = {"inputs": channels, "classes": 3, "bin_s": 0.0003, "floor": -200, "out_floor": -200}
        chip = ChipConfig(readout=readout, classifier=ClassifierConfig.from_dict(base | own))
        yield Run(f"chip {encoding}", chip, stimuli.chip, only=("eskin_bin_timer",))


def _boards() -> Iterator[Run]:
    for design in ("player", "receiver"):
        own = tuple(f"eskin_board_{part}" for part in ("uart_receiver", "uart_sender", "frames_crc"))
        yield Run(f"board {design}", small_board(design), board, only=own)


def _buses() -> Iterator[Run]:
    """Yield runs of readouts behind AXI, with and without registers and time stamps."""
    few = SMALL.replace(rows=2)
    for config in (
        BusConfig(readout=few.replace(registers="spi"), time_bits=4),
        BusConfig(readout=few.replace(rows=1, encoding="nlcs", reset="async"), time_bits=6),
    ):
        own = tuple(f"eskin_axi{part}" for part in ("", "_stream", "_lite"))
        yield Run(f"axi {config.readout.encoding}", config, stimuli.axi, only=own)
