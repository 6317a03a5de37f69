"""Which modules of the RTL are mutated, and which checks of the project are to notice."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Ground:
    """A module of ``rtl/`` and the checks that look at it.

    Parameters
    ----------
    block : str
        The block that it is a part of.
    tests : tuple of str
        Co-simulations against the golden models in ``cocotb_tests``: names of test files, in the order in which they
        are run. Cases on Verilator are left out: they play the same test on another simulator.
    proofs : tuple of str
        Blocks of ``make formal`` whose properties look at it.
    others : tuple of str
        Test files that look at it without a simulation; each is run in a process of its own with a mutant planted.
    """

    block: str
    tests: tuple[str, ...]
    proofs: tuple[str, ...] = ()
    others: tuple[str, ...] = ()


LONG = ("readout", "host", "analog", "tiles", "touch")
"""Tests of whole readouts, each of some seconds: the last to be asked."""

STILL = ("tests/flow/test_still.py",)
"""Whether a block that says it is not awake stands still: what it says is used by the clock gates alone."""

NOT_ASKED = (
    "test_a_fault_between_sample_and_class_is_found",
    "test_touch_plays_an_image_once_and_draws_it_from_texture_to_class",
)
"""Tests that are left out: one has a fault beside the RTL, by which the original fails too, as it must; the other is a
command that plays on Verilator.
"""

GROUNDS = {
    "link": Ground("link", ("link", "readout"), ("link", "readout"), STILL),
    "window": Ground("window", ("window", "taxel", "analog", "readout", "host"), ("window", "taxel"), STILL),
    "decay": Ground("decay", ("decay", "readout")),
    "arbiter": Ground("arbiter", ("arbiter", "readout"), ("arbiter", "readout"), STILL),
    "logic": Ground("arbiter", ("arbiter", "merge", "taxel", "frame", "registers", "readout"), ("arbiter", "merge")),
    "tiles.merge": Ground("tiles", ("merge", "tiles"), ("merge",)),
    "tiles.relay": Ground("tiles", ("relay", "merge", "tiles"), ("relay", "merge")),
    "tiles.skin": Ground("tiles", ("tiles",)),
    "taxel": Ground("taxel", ("taxel", "window", "analog", "readout", "host"), ("taxel", "window", "readout"), STILL),
    "frame": Ground("frame", ("frame",), ("frame_readout",), STILL),
    "registers.file": Ground("registers", ("registers", "host"), ("registers",)),
    "registers.host": Ground("registers", ("host",)),
    "registers.pattern": Ground("registers", ("pattern", "host"), ("pattern",)),
    "registers.spi": Ground("registers", ("spi", "host"), ("spi",)),
    "registers.decay": Ground("registers", ("decay", "host")),
    "classifier.numbers": Ground("classifier", ("classifier", "touch")),
    "classifier.lane": Ground("classifier", ("classifier", "touch")),
    "classifier.memory": Ground("classifier", ("memory", "classifier", "touch")),
    "classifier.core": Ground("classifier", ("classifier", "touch")),
    "classifier.chip": Ground("classifier", ("chip", "touch")),
    "readout": Ground("readout", ("readout", "analog", "host", "tiles"), ("readout",), STILL),
}
"""All modules of ``rtl/`` with logic in them, and what looks at each."""

GUARDS = {
    "eskin_arbiter": dict.fromkeys(("event_row", "event_col", "event_polarity"), "event_valid"),
    "eskin_readout": dict.fromkeys(("event_row", "event_col", "event_polarity"), "event_valid"),
    "eskin_merge": {f"event_{name}": "event_valid" for name in ("tile", "row", "col", "polarity")},
    "eskin_relay": dict.fromkeys(("event_row", "event_col", "event_polarity"), "event_valid"),
    "eskin_taxel": {"polarity": "request"},
    "eskin_row": {"column_polarity": "column_request"},
    "eskin_pattern": {"column_polarity": "row_request", "column_request": "row_request"},
    "eskin_frame_sequencer": dict.fromkeys(("sample_code", "sample_first", "sample_last"), "sample_valid"),
    "eskin_frame_packer": dict.fromkeys(("word_data", "word_sync"), "word_valid"),
    "eskin_frame_readout": dict.fromkeys(("word_data", "word_sync"), "word_valid"),
    "eskin_spi": {"write_data": "write"},
    "eskin_classifier": {
        f"{kind}_{name}": f"{kind}_valid" for kind in ("hidden", "output") for name in ("index", "potential", "spike")
    },
}
"""Outputs that mean something only where another is not 0, by the contract of a stream; by module."""
