"""Report the resources and the clock of an FPGA design against targets."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eskin.base.files import atomic_write, make_folder, write_json
from eskin.board.bitstream.build import Built
from eskin.model.classifier.config import ClassifierConfig, bits_of

MAX_LUTS = 1600
MAX_OWN_LUTS = 1700
MAX_BLOCKS = {8: 49, 4: 25}
MAX_STACK_BLOCKS = {8: 34}
"""Targets for the classifier 128-256-6: LUT4 without multipliers, with own parameters, and block RAMs by the bits of a
weight, also of a stack with own parameters; without a stack, own parameters take one more."""

MARGIN = 40
"""Margin of an early decision, as a number of output spikes; its size does not change the resources."""


@dataclass(frozen=True)
class Aim:
    """A measured number and its target."""

    what: str
    found: float
    wanted: float
    met: bool

    def __str__(self) -> str:
        verdict = "met" if self.met else "MISSED"
        return f"{self.what}: {self.found:g}, aimed at {self.wanted:g}: {verdict}"


def clock_aim(built: Built) -> Aim:
    """Return the clock frequency and its target."""
    return Aim(
        "clock, routed, MHz (at least)",
        round(built.clock_hz / 1e6, 1),
        built.aim_hz / 1e6,
        built.clock_hz >= built.aim_hz,
    )


def classifier_aims(built: Built, config: ClassifierConfig) -> list[Aim]:
    """Return the classifier's resources and their targets."""
    own, bits = config.own_parameters, config.in_bits
    luts = MAX_OWN_LUTS if own else MAX_LUTS
    aims = [clock_aim(built), Aim("LUT4 (at most)", built.luts, luts, built.luts <= luts)]
    blocks = MAX_STACK_BLOCKS if config.layers else MAX_BLOCKS
    if bits in blocks:
        most = blocks[bits] + (own and not config.layers)
        aims.append(Aim("block RAMs (at most)", built.blocks, most, built.blocks <= most))
    return aims


def plain_classifier(bits: int, own: bool = False, stack: bool = False, early: bool = False) -> ClassifierConfig:
    """Return the configuration of a classifier 128-256-6 with a given weight width, as ``eskin quantise`` makes it.

    - ``own``: with a threshold and a leak for each neuron.
    - ``stack``: the neurons are two recurrent layers of 128.
    - ``early``: with an early decision.
    """
    shift = max(6 - bits, 0)  # the unit of the potential is finer than a coarse weight
    fields: dict[str, Any] = dict.fromkeys(("in_bits", "rec_bits", "out_bits"), bits)
    fields |= dict.fromkeys(("in_shift", "rec_shift", "out_shift"), shift)
    fields["own_parameters"] = own
    rough = ClassifierConfig(**fields, floor=-256, out_floor=-256, leak_shift=2, membrane_bits=32, output_bits=32)
    return rough.replace(
        layers=((0, 128, (0,)), (128, 256, (0, 1))) if stack else (),
        margin=MARGIN if early else 0,
        membrane_bits=rough.narrow_bits,
        output_bits=int(bits_of(rough.output_range)),
        evidence_bits=11,
    )


def closing_line(board: str, built: Built) -> str:
    """Return the final message of a run."""
    return f"fpga: {board}, {built.clock_hz / 1e6:.1f} MHz, {built.luts} LUTs, {built.memory_kilobytes:g} kB of memory"


def write(out: Path, name: str, built: Built, said: dict[str, Any], aims: list[Aim]) -> Path:
    """Write the files and the report of a run into OUT/NAME, and return the path of the report."""
    folder = make_folder(out, name)
    for file_name, content in built.files.items():
        with atomic_write(folder / file_name) as file:
            file.write(content)
    report: dict[str, Any] = said | {
        "clock_hz": built.clock_hz,
        "clock_aimed_hz": built.aim_hz,
        "luts": built.luts,
        "block_rams": built.blocks,
        "memory_bytes": round(built.memory_kilobytes * 1024),
        "used": built.used,
        "available": built.available,
        "aims": [vars(aim) for aim in aims],
    }
    write_json(folder / "report.json", report)
    return folder / "report.json"
