"""Compare RTL and golden model with every parameter at its smallest and largest value."""

import dataclasses
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eskin.base.errors import InputError
from eskin.cocotb_tests.bench.random_run import RandomRun
from eskin.cocotb_tests.runner.process import ReadoutRun, play_runs
from eskin.cocotb_tests.runner.simulator import build
from eskin.model.cases import axes, cases, singles
from eskin.model.config import MAX_LEAK_PERIOD, MAX_SIDE, ReadoutConfig
from eskin.model.events.compare import first_difference
from eskin.model.readout import Stimulus, simulate
from tests.random_cases.player import Design

SMALL = ReadoutConfig(rows=1, columns=2, sample_bits=6, resolution=3, leak_shift=2, leak_period=3, fraction_bits=3)
BASE = SMALL.replace(closing_shift=1, window_period=2).to_dict()


@dataclass(frozen=True)
class End:
    """A parameter at a limit, with the other required fields, and an out-of-range value."""

    name: str
    value: int
    beyond: int
    encoding: str = "lcs"
    others: dict[str, Any] = field(default_factory=dict)

    @property
    def fields(self) -> dict[str, Any]:
        """Fields to set in a random configuration."""
        return BASE | {"encoding": self.encoding} | self.others | {self.name: self.value}


LEVELS = cases(ReadoutConfig.from_dict(BASE | {"resolution": 2}), **axes("encoding"))
CODES = {c.encoding: (c.encoder.lowest(c), c.full_scale - c.grid) for c in LEVELS}
"""Lowest and highest level of a reference of 6 bits with a step of 4 codes."""

ENDS = [
    End("rows", 1, 0),
    End("rows", MAX_SIDE, MAX_SIDE + 1, others={"columns": 1}),
    End("columns", 1, 0, "cw-lcs"),
    End("columns", MAX_SIDE, MAX_SIDE + 1, "nlcs", {"rows": 1, "leak_period": 64}),
    *(End("sample_bits", 3, 2, encoding, {"resolution": 1}) for encoding in CODES),
    *(End("sample_bits", 24, 25, encoding) for encoding in CODES),
    *(End("resolution", 1, 0, encoding) for encoding in CODES),
    *(End("resolution", 4, 5, encoding) for encoding in CODES),
    *(End("resolution", 22, 23, encoding, {"sample_bits": 24}) for encoding in CODES),
    *(End("reference_reset", low, -33 if low else -1, name, {"resolution": 2}) for name, (low, _) in CODES.items()),
    *(End("reference_reset", high, 32, name, {"resolution": 2}) for name, (_, high) in CODES.items()),
    End("closing_shift", 0, -1, "cw-lcs"),
    End("closing_shift", 16, 17, "cw-lcs", {"sample_bits": 20, "resolution": 1}),
    End("window_period", 1, 0, "cw-lcs"),
    End("window_period", 2**16, 2**16 + 1, "cw-lcs"),
    End("leak_shift", 1, 0, "nlcs"),
    End("leak_shift", 16, 17, "nlcs", {"leak_period": 1, "sample_bits": 12, "fraction_bits": 16}),
    End("leak_period", 1, 0, "nlcs"),
    End("leak_period", MAX_LEAK_PERIOD, MAX_LEAK_PERIOD + 1, "nlcs"),
    End("fraction_bits", 0, -1, "nlcs"),
    End("fraction_bits", 28, 29, "nlcs", {"sample_bits": 3, "resolution": 1, "leak_shift": 1, "leak_period": 1}),
]

STIMULI: tuple[dict[str, Any], ...] = (
    {"signal": "square", "gap": 3, "sink": "always", "masks": 0},
    {"signal": "noise", "gap": 1, "sink": "random", "masks": 100},
    {"signal": "near", "gap": 12, "sink": "slow", "masks": 3},
)
NO_HARDWARE = {"sample_rate_hz", "clocks_per_sample"}
"""Units of time: nothing of them is in the RTL."""


def sides(end: End) -> list[ReadoutConfig]:
    """Return configurations with every front end and link; one in turn for a parameter of all encoders."""
    found = singles(ReadoutConfig.from_dict(end.fields), **axes("frontend", "link"))
    of_all = [one for one in ENDS if one.name in ("sample_bits", "resolution", "reference_reset")]
    return [found[of_all.index(end) % len(found)]] if end in of_all else found


@pytest.mark.parametrize("end", ENDS, ids=lambda end: f"{end.name}-{end.value}-{end.encoding}")
def test_rtl_equals_the_model_at_an_end(end: End) -> None:
    events = 0
    for config in sides(end):
        design = Design(config)
        for run, own in enumerate(STIMULI):
            stimulus = RandomRun(config, seed=run, clocks=120, **own).stimulus
            expected = simulate(config, stimulus)
            assert first_difference(expected, design.play(stimulus)) is None, (config, own)
            events += len(expected)
    assert events > 20
    with pytest.raises(InputError, match=end.name):
        ReadoutConfig.from_dict(end.fields | {end.name: end.beyond})


def test_every_number_of_the_build_has_both_ends_here() -> None:
    numbers = {one.name for one in dataclasses.fields(ReadoutConfig) if one.type in ("int", "float")}
    ends = {name: {end.value for end in ENDS if end.name == name} for name in numbers - NO_HARDWARE}
    assert all(len(values) >= 2 for values in ends.values()), ends


LONGEST = {
    "window_period": ({"encoding": "cw-lcs", "window_period": 2**16}, 2 * 2**16),
    "leak_period": ({"encoding": "nlcs", "leak_period": MAX_LEAK_PERIOD, "leak_shift": 1}, MAX_LEAK_PERIOD),
}
"""Configurations of one taxel, and the sample ticks until something must come of the period."""


@pytest.mark.parametrize("name", LONGEST)
def test_the_longest_periods_end_when_the_model_says(name: str, tmp_path: Path) -> None:
    """Compare the longest periods with the model, with a constant sample in every clock."""
    own, ticks = LONGEST[name]
    config = ReadoutConfig.from_dict(BASE | own | {"columns": 1, "resolution": 1})
    level = config.step - 1 if name == "window_period" else config.full_scale - 1
    samples = np.full((ticks + 40, 1), level, np.int32)
    stimulus = Stimulus.from_samples(config, samples, clocks_per_sample=1)
    assert simulate(config, stimulus)["t"][-1] > ticks // 2  # the period's own doing
    tally = play_runs(build(config, "verilator"), [ReadoutRun(config, name, stimulus, "")], tmp_path)
    assert tally.clocks == stimulus.clocks
