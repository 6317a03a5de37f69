"""Where a block says that it is not awake its clock may stop: no register would change."""

from __future__ import annotations

from typing import Any

import pytest

from flow.formal.mutants import Mutant, planted
from flow.formal.still import stands_still
from model.config import ReadoutConfig
from model.frame_config import FrameConfig
from rtl import readout, taxel
from rtl.arbiter import Arbiter
from rtl.frame import FrameReadout

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
    ("what", "old", "new"),
    [
        ("sleeps through a grant", "            self.granted,\n            *(getattr", "            *(getattr"),
        ("sleeps through a mask", "self.stirs.eq(switched | ", "self.stirs.eq("),
        ("sleeps while it asks", "(~own.pending & own.asks)", "(own.pending & own.asks)"),
        ("sleeps while its window closes", " | own.closing)", ")"),
    ],
)
def test_a_row_that_sleeps_when_it_must_not_is_found(what: str, old: str, new: str) -> None:
    with planted(Mutant(what, "taxel", old, new)):
        assert not stands_still(taxel.Row(FEW.replace(encoding="cw-lcs")))
