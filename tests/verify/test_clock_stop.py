"""Where a block says that it is not awake its clock may stop: no register would change."""

from __future__ import annotations

from typing import Any

import pytest

from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import FrameConfig
from eskin.rtl import readout, taxel
from eskin.rtl.arbiter import Arbiter
from eskin.rtl.block import Netlist
from eskin.rtl.frame import FrameReadout
from eskin.verify.proofs.clock_stop import stands_still
from eskin.verify.proofs.mutants import make

FEW = ReadoutConfig(rows=2, columns=2, sample_bits=6, resolution=2, window_period=3, leak_period=3)
BLOCKS = [
    Arbiter(FEW),
    *(
        taxel.Row(FEW.replace(encoding=code, decide_every=pace))
        for code, pace in (("lcs", "sample"), ("nlcs", "clock"))
    ),
    taxel.Row(FEW.replace(encoding="cw-lcs", frontend="analog")),
    readout.Readout(FEW.replace(encoding="cw-lcs", link="four_phase")),
    readout.Readout(FEW.replace(encoding="nlcs", frontend="analog")),
    readout.Readout(FEW.replace(encoding="nlcs", registers="spi")),
    FrameReadout(FrameConfig(readout=FEW)),
]


@pytest.mark.parametrize(
    "block", BLOCKS, ids=lambda block: f"{block.module_name}-{getattr(block.config, 'encoding', '')}"
)
def test_a_block_that_is_not_awake_stands_still(block: Any) -> None:
    assert stands_still(block)


def test_a_block_that_is_awake_moves() -> None:
    assert not stands_still(Arbiter(FEW), awake=1)


@pytest.mark.parametrize(
    "wire", ["stirs -module eskin_taxel", "taxel_1_stirs -module eskin_row -cell taxel_1", "closing -port B", "awake"]
)
def test_a_row_that_sleeps_when_it_must_not_is_found(wire: str) -> None:
    row = taxel.Row(FEW.replace(encoding="cw-lcs"))
    made = Netlist(async_reset=False)
    made.add(row)
    found = make(made.text, row.module_name, 4, 0, f"-mode const0 -wire {wire}")
    assert found
    assert not any(stands_still(row, mutant=mutant.rtlil) for mutant in found)
