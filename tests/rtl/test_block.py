"""Test that equal blocks of a netlist share a module, and that different blocks do not."""

import pytest

from eskin.model.config import ReadoutConfig
from eskin.rtl.block import RtlilModules
from eskin.rtl.taxel import Taxel
from eskin.rtl.window import ClosingWindow

CONFIG = ReadoutConfig(rows=1, columns=1, encoding="cw-lcs")


@pytest.mark.representative(block="block")
def test_equal_blocks_share_their_text() -> None:
    netlist = RtlilModules(async_reset=False)
    assert netlist.add(Taxel(CONFIG)) is netlist.add(Taxel(CONFIG.replace()))
    assert list(netlist.modules) == [ClosingWindow.module_name, Taxel.module_name]
    assert netlist.text.count("module \\eskin_taxel\n") == 1


def test_two_configurations_under_one_name_are_refused() -> None:
    netlist = RtlilModules(async_reset=False)
    netlist.add(Taxel(CONFIG))
    with pytest.raises(ValueError, match=r"^two different blocks are named eskin_taxel: Taxel of ReadoutConfig\("):
        netlist.add(Taxel(CONFIG.replace(resolution=3)))


def test_two_blocks_under_one_name_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    netlist = RtlilModules(async_reset=False)
    netlist.add(Taxel(CONFIG))
    monkeypatch.setattr(ClosingWindow, "module_name", "eskin_taxel")
    with pytest.raises(ValueError, match=r"and ClosingWindow of ReadoutConfig\(.*; give one block another name$"):
        netlist.add(ClosingWindow(CONFIG))
