"""Test that every kind of delivered Verilog is proved equivalent, and that wrong Verilog is found."""

import functools
import re
from typing import Any, get_args

import pytest

from eskin.board.config import BoardConfig, SerialConfig
from eskin.board.gateware import top as board
from eskin.model.bus.config import BusConfig
from eskin.model.cases import AXES, axes, pairs, singles, values_of
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import FrameConfig
from eskin.model.tiles.config import MergeConfig, TilesConfig
from eskin.rtl import yosys
from eskin.rtl.verilog import Config, rtlil, verilog
from eskin.verify.proofs.delivered import Different, prove

READOUT = ReadoutConfig(rows=2, columns=3)
LOGIC = axes("encoding", "frontend", "link", "reset", "decide_every", "registers")
READOUTS = [*pairs(READOUT, **LOGIC), *singles(READOUT.replace(leak_period=9), **AXES)]
FEW_BITS: dict[str, Any] = {"membrane_bits": 8, "threshold": 60, "floor": -100, "out_threshold": 60, "out_floor": -100}
CLASSIFIER = ClassifierConfig(inputs=4, hidden=4, classes=2, lanes=2, clocks_per_bin=60, **FEW_BITS)
SMALL = ReadoutConfig(rows=1, columns=2, sample_bits=6, resolution=3)
TILES = TilesConfig.of(SMALL, 1, 2, 1)

KINDS: dict[str, Config] = {
    "lcs": READOUT,
    "registers": READOUT.replace(registers="spi"),
    "async": READOUT.replace(reset="async"),
    **{" ".join(values_of(config).values()): config for config in READOUTS},
    "frames": FrameConfig(readout=READOUT),
    "tiles": TILES,
    "merge": MergeConfig(TILES),
    "bus": BusConfig(readout=READOUT.replace(registers="spi"), time_bits=5),
    "classifier": CLASSIFIER,
    "chip": ChipConfig(readout=SMALL, classifier=CLASSIFIER),
}


def test_there_is_a_design_of_every_kind() -> None:
    assert {type(config) for config in KINDS.values()} == {*get_args(Config), TilesConfig}


@functools.cache
def texts(kind: str) -> tuple[str, str]:
    """Return RTLIL and Verilog of a design."""
    return rtlil(KINDS[kind]), verilog(KINDS[kind])


@pytest.mark.parametrize("kind", KINDS)
def test_the_text_is_proved_equal_to_the_rtlil(kind: str) -> None:
    text, delivered = texts(kind)
    points = prove(text, delivered)
    assert set(points) == set(yosys.modules(text))
    assert sum(points.values()) >= 15


def test_a_large_array_is_proved_by_its_modules() -> None:
    config = ReadoutConfig(rows=12, columns=16)
    points = prove(rtlil(config), verilog(config))
    assert points["eskin_readout"] > config.taxels > points["eskin_taxel"] > 20


def test_the_design_of_a_board_is_proved_with_its_initial_values() -> None:
    config = BoardConfig(chip=None, serial=SerialConfig(baud=6_250_000, buffer_bytes=512, records=128))
    text, written = board.netlist(config), board.verilog(config)
    assert prove(text, written, initial=True)[board.TOP] > 30
    begun = re.search(r"^  reg (\[.*\] )?\w+ = \d+'h0*1;$", written, re.MULTILINE)
    assert begun
    with pytest.raises(Different, match="initial values of "):
        prove(text, written.replace(begun[0], re.sub(r"1;$", "0;", begun[0])), initial=True)


WRONG = {
    "an operator": ("lcs", r"pending & enable", "pending | enable", r": eskin_taxel:request"),
    "a value after reset": ("merge", r"if \(rst\) behind <= 1'h0", "if (rst) behind <= 1'h1", r"eskin_merge:behind"),
    "an enable": ("registers", r"if \(takes\) behind", "if (~takes) behind", r"eskin_arbiter:behind"),
    "a reset": ("async", r"@\(posedge clk, posedge rst\)", "@(posedge clk)", r": eskin_arbiter:"),
    "a row of bits": ("lcs", r"sample\[35:0\]", "sample[36:1]", r": eskin_readout:.*\.sample\["),
    "an input of an instance": ("frames", r"\.word_ready\(word_ready\)", ".word_ready(1'h1)", r": \S+\.word_ready$"),
    "an instance": ("tiles", r"  eskin_relay relay_1_0 \([^;]*;", "", "and memories of eskin_tiles .*: relay_1_0"),
    "a port": ("merge", r"wire \[1:0\] tile_col", "wire [2:0] tile_col", "ports of eskin_merge .*: tile_col$"),
    "a module": ("tiles", r"eskin_relay", "eskin_station", "modules are not .*: eskin_relay, eskin_station$"),
    "a memory": ("classifier", r"memory \[(\d+):0\]", "memory [63:0]", "instances and memories of .*: memory$"),
    "an address": ("classifier", r"memory\[write_address\]", "memory[read_address]", r"\.WR_ADDR"),
    "a value that is undefined": ("merge", r"behind <= 1'h0", "behind <= 1'hx", "undefined constant 'hx"),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_text_is_found(what: str) -> None:
    kind, old, new, problem = WRONG[what]
    gold, text = texts(kind)
    wrong = re.sub(old, new, text, count=0 if what == "a module" else 1)
    assert wrong != text
    with pytest.raises(Different, match=problem):
        prove(gold, wrong)


def test_the_command_proves_what_it_writes(call: Any) -> None:
    code, out, error = call("verilog --tiles 1x2 --merge --prove --out out")
    assert code == 0, error
    assert re.search(r"^proved equal to the RTLIL: \d\d+ points of 1 modules$", out, re.MULTILINE)
