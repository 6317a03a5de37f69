"""Test that every port of every readout is constrained, by OpenSTA's ``check_setup``."""

import functools
import shutil
from collections.abc import Callable

import pytest

from eskin.flow.asic import timing
from eskin.flow.asic.equivalence import design_of
from eskin.flow.asic.synthesis import Config, Netlist, synthesise
from eskin.flow.liberty.library import Library
from eskin.flow.report import constant_outputs
from eskin.model.cases import axes, cases
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import FrameConfig
from eskin.model.tiles.config import TilesConfig
from eskin.rtl.delivery import ports

pytestmark = pytest.mark.skipif(shutil.which("sta") is None, reason="OpenSTA is not installed: apt-get install opensta")

TWO = ReadoutConfig(rows=1, columns=2)

KINDS: dict[str, Config] = {
    "analog, window, SPI, four-phase": TWO.replace(
        encoding="cw-lcs", frontend="analog", registers="spi", link="four_phase"
    ),
    "digital, leak, SPI, stream, async reset": TWO.replace(
        rows=2, columns=1, encoding="nlcs", registers="spi", reset="async"
    ),
    "analog, leak: constant bits of references": TWO.replace(encoding="nlcs", frontend="analog"),
    "two requests": TWO.replace(link="four_phase_dual"),
    "frames": FrameConfig(readout=ReadoutConfig(rows=2, columns=2)),
    "tiles and their merge": TilesConfig.of(TWO, 1, 2),
}
"""Together they have every port that a readout may have."""


@pytest.fixture(scope="module")
def made_of(library: Library) -> Callable[[str], Netlist]:
    """Return a function that gives the netlist of a kind, synthesised once."""
    return functools.cache(lambda kind: synthesise(KINDS[kind], library))


@pytest.mark.parametrize("kind", KINDS)
def test_no_port_of_a_readout_is_without_a_constraint(
    kind: str, made_of: Callable[[str], Netlist], library: Library
) -> None:
    made = made_of(kind)
    found = timing.analyse(made, library, constant_outputs(made, design_of(made)))
    assert found.complaints == ()
    assert found.fmax_hz > 20e6
    assert found.depth > 2
    assert found.hold_slack_s > -1e-9


def test_a_pin_of_the_host_that_is_forgotten_is_seen(
    made_of: Callable[[str], Netlist], library: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = made_of(next(iter(KINDS)))
    whole = timing.sdc(made, "$period")
    assert "spi_mosi" in whole
    monkeypatch.setattr(timing, "sdc", lambda *_: whole.replace("spi_mosi", "spi_sck"))
    said = timing.analyse(made, library, constant_outputs(made, design_of(made))).complaints
    assert any("spi_mosi" in line for line in said)


def test_the_kinds_have_every_port_between_them() -> None:
    every = {
        port["name"]
        for config in cases(TWO.replace(rows=2, registers="spi"), **axes("encoding", "frontend", "link"))
        for port in ports(config)
    }
    shown = {port["name"] for config in KINDS.values() for port in ports(config)}
    assert every - shown == {"step_code"}  # D for comparators without a window: as half_width, from flops
