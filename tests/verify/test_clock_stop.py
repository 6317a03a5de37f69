"""Test that a block's clock may stop while ``awake`` is low, and stops in an idle block."""

import re
from typing import Any

import pytest

from eskin.cocotb_tests.runner.simulator import may_skip
from eskin.cocotb_tests.test_chip import CHIPS
from eskin.cocotb_tests.test_classifier import CONFIGS, OWN, SYNAPTIC
from eskin.model.cases import axes, cases
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import FrameConfig
from eskin.rtl.arbiter import Arbiter
from eskin.rtl.classifier.chip import Chip
from eskin.rtl.classifier.core import Classifier
from eskin.rtl.frame import FramePacker, FrameReadout, FrameSequencer
from eskin.rtl.readout import Readout
from eskin.rtl.registers.host import Host
from eskin.rtl.taxel import Row
from eskin.rtl.verilog import top_block
from eskin.verify.proofs.bench import rtlil_of
from eskin.verify.proofs.clock_stop import Clocked, clocked, stands_still
from eskin.verify.proofs.mutants import make

FEW = ReadoutConfig(rows=2, columns=2, sample_bits=6, resolution=2, window_period=3, leak_period=3)
SKIPPED: list[Any] = [
    *cases(FEW, **axes("encoding"), more=({}, {"decide_every": "sample"}, {"receptive_fields": "neighbours"})),
    *CHIPS,
]
"""A configuration of every kind for which the co-simulation skips idle clocks: all that ``awake`` depends on."""
NETWORKS = [CONFIGS[1], CONFIGS[4], CONFIGS[6], *SYNAPTIC, OWN[1]]
"""Classifiers with outputs of both kinds, with and without groups, saturation and synaptic currents."""
BLOCKS = [
    Arbiter(FEW),
    Row(FEW.replace(encoding="lcs", decide_every="sample")),
    Row(FEW.replace(encoding="nlcs")),
    Row(FEW.replace(encoding="cw-lcs", frontend="analog")),
    Readout(FEW.replace(encoding="cw-lcs", link="four_phase")),
    Readout(FEW.replace(encoding="nlcs", frontend="analog")),
    Readout(FEW.replace(encoding="nlcs", registers="spi")),
    FrameReadout(FrameConfig(readout=FEW)),
    *map(Classifier, NETWORKS),
]


@pytest.mark.parametrize(
    "block", BLOCKS, ids=lambda block: f"{block.module_name}-{getattr(block.config, 'encoding', '')}"
)
def test_a_block_that_is_not_awake_stands_still(block: Any) -> None:
    assert stands_still(block)


@pytest.mark.parametrize("config", SKIPPED, ids=lambda c: "-".join(map(str, list(c.to_dict().values())[2:7])))
def test_the_clocks_that_the_co_simulation_skips_change_nothing(config: ReadoutConfig | ChipConfig) -> None:
    assert may_skip(config)
    assert stands_still(top_block(config))


@pytest.mark.parametrize("block", [Arbiter(FEW), Classifier(NETWORKS[0]), Chip(CHIPS[0])], ids=type)
def test_a_block_that_is_awake_moves(block: Any) -> None:
    assert not stands_still(block, awake=1)


@pytest.mark.parametrize(
    "wire",
    [
        "needs_clock -module eskin_taxel",
        "taxel_1_needs_clock -module eskin_row -cell taxel_1",
        "closing -port B",
        "awake",
    ],
)
def test_a_row_that_sleeps_when_it_must_not_is_found(wire: str) -> None:
    row = Row(FEW.replace(encoding="cw-lcs"))
    found = make(rtlil_of(row), row.module_name, 4, 0, f"-mode const0 -wire {wire}")
    assert found
    assert not any(stands_still(row, mutant=mutant.rtlil) for mutant in found)


@pytest.mark.parametrize("term", ["arbiter_awake", "row_0_awake", "row_1_awake", "tick"])
def test_a_term_that_the_readout_leaves_out_is_found(term: str) -> None:
    top = Readout(FEW.replace(encoding="nlcs"))
    others, name, own = rtlil_of(top).partition(f"module \\{top.module_name}\n")
    mutant, count = re.subn(rf"(connect \\[AB]) \\{term} \[0\]\n", r"\1 1'0\n", own)
    assert count == 1
    assert not stands_still(top, mutant=others + name + mutant)


@pytest.mark.parametrize("term", ["load_valid", "class_valid"])
def test_a_term_that_the_classifier_leaves_out_is_found(term: str) -> None:
    block = Classifier(NETWORKS[0])
    text = rtlil_of(block)
    (terms,) = (found for found in re.findall(r"connect \\A (\{[^}]*\})", text) if f"\\{term} [0]" in found)
    assert not stands_still(block, mutant=text.replace(terms, terms.replace(f"\\{term} [0]", "1'0")))


def test_a_memory_that_reads_in_every_clock_is_found() -> None:
    block = Classifier(NETWORKS[0])
    found = make(rtlil_of(block), block.module_name, 3, 1, "-mode const1 -wire read_valid")
    assert len(found) == 3
    assert not any(stands_still(block, mutant=mutant.rtlil) for mutant in found)


PAIR = FEW.replace(rows=1)
CLOSING, LEAKING = PAIR.replace(encoding="cw-lcs"), PAIR.replace(encoding="nlcs")
HOSTED = LEAKING.replace(registers="spi")
FRAMES = FrameConfig(readout=FEW)
BETWEEN = {"sample_valid": 0, "taxel_enable": 3}
NO_STEP = {"above": 0}
NO_SAMPLE, SAMPLE = {"sample_valid": 0}, {"sample_valid": 1}
LINK = ("link.ack_meta", "link.ack_sync", "link.setup")
PINS = ("spi.sck", "spi.cs_n", "spi.mosi")
ON = {f"row_0.taxel_{column}.enabled": 1 for column in range(2)}
FREE = {f"taxel_{column}.pending": 0 for column in range(2)}


def each(*names: str) -> tuple[str, ...]:
    """Return the register names of both taxels of a row."""
    return tuple(f"taxel_{column}.{name}" for column in range(2) for name in names)


IDLE = {"rest": NO_SAMPLE}
HOST_PINS = tuple(f"host.{name}" for name in PINS)
NEWEST = ("tick", "row_0.awake", "awake", *(f"row_0.{name}" for name in each("newest")))
CLOSED = {f"row_0.{name}": 0 for name in FREE}
IN_ROW = {"granted": 0, "decay": 0, "enable": 3} | NO_SAMPLE
AT_REST: dict[str, tuple[Any, tuple[str, ...], dict[str, Any]]] = {
    "nothing": (Readout(PAIR), (), IDLE),
    "nothing, analog": (Readout(LEAKING.replace(frontend="analog")), (), {"rest": NO_SAMPLE | NO_STEP}),
    "nothing, handshake": (Readout(CLOSING.replace(link="four_phase")), LINK, IDLE | {"held": {"link.ack_sync": 0}}),
    "nothing, host": (Readout(HOSTED), HOST_PINS, IDLE | {"held": {"host.registers.test_mode": 0}}),
    "a sample that is the one before": (Readout(LEAKING), NEWEST, {"rest": BETWEEN, "then": SAMPLE, "held": ON}),
    "its tick, windows closed": (
        Readout(CLOSING.replace(frontend="analog")),
        ("tick", "row_0.awake", "awake", *(f"row_0.{name}" for name in each("asked"))),
        {"rest": BETWEEN | SAMPLE | NO_STEP | {"below": 0}, "then": NO_SAMPLE, "held": CLOSED | ON},
    ),
    "its tick, decided by the sample": (
        Row(PAIR.replace(decide_every="sample")),
        (),
        {"rest": {"granted": 0, "tick": 1} | NO_SAMPLE},
    ),
    "a leak": (
        Row(LEAKING),
        ("awake", *each("charge", "enabled", "pending")),
        {"rest": IN_ROW, "then": {"decay": 1}},
    ),
    "no frame": (FrameReadout(FRAMES), (), {"rest": {"frame_start": 0, "adc_done": 0}}),
}
ARRIVES = dict.fromkeys(("event_valid", "bin_end", "scan_start", "load_valid"), 0)
NO_EVENT = {"rest": ARRIVES, "held": {"clearing": 0}}
AT_REST |= {f"no event, {n.readout}, {n.lanes} lanes": (Classifier(n), (), NO_EVENT) for n in NETWORKS[1:4]}
"""What gets a clock where nothing changes: nothing but what takes a sample, and what listens."""


@pytest.mark.parametrize("case", AT_REST)
def test_in_a_readout_at_rest_nothing_else_has_a_clock(case: str) -> None:
    block, expected, given = AT_REST[case]
    assert clocked(block, expected, **given) == Clocked((), True)


WASTE = [
    (Arbiter(PAIR), {"rest": {"event_ready": 0, "row_request": 0}}, "const1 -wire awake -module eskin_arbiter"),
    (Row(PAIR), {"rest": {"granted": 0} | NO_SAMPLE}, "const1 -wire needs_clock -module eskin_taxel"),
    (
        Row(CLOSING),
        {"rest": {"granted": 0, "tick": 1, "enable": 3} | NO_SAMPLE, "held": FREE},
        "inv -wire closed",
    ),
    (FrameSequencer(FRAMES), {"rest": {"frame_start": 0, "adc_done": 0}}, "const1 -wire awake"),
    (FramePacker(FRAMES), {"rest": {"sample_valid": 0}}, "const1 -wire awake"),
    (
        Host(HOSTED),
        {"expected": PINS, "held": {"registers.test_mode": 0}},
        "const1 -wire write_resolution -module eskin_registers",
    ),
]
"""Blocks, when they are at rest, and mutants that give them a clock there."""


@pytest.mark.parametrize(("block", "given", "mutation"), WASTE, ids=lambda value: getattr(value, "module_name", ""))
def test_a_clock_that_is_not_needed_is_found(block: Any, given: dict[str, Any], mutation: str) -> None:
    (mutant, *_) = make(rtlil_of(block), block.module_name, 1, 0, f"-mode {mutation}")
    assert clocked(block, **given) == Clocked((), True)
    assert clocked(block, **given, mutant=mutant.rtlil).others
