"""Counts: empty bins, and the likeness of event counts between resolutions of an encoder, on the same scans."""

import itertools

from eskin.base.progress import bar
from eskin.model.config import ReadoutConfig
from eskin.snn.data.scans import empty_bins, likeness
from eskin.snn.experiments.experiment import Experiment
from studies.study import Data, Result, run

POINTS = ("nlcs:6", "nlcs:8", "nlcs:10", "lcs:6")
"""Encoders with their resolutions."""

PRESET = "paper"


def compute() -> Data:
    """Return the share of empty bins and the event rate of every point, and the likeness of two of one encoder."""
    found = {}
    for name in POINTS:
        encoding, _, bits = name.partition(":")
        config = ReadoutConfig.from_dict({"encoding": encoding, "resolution": int(bits)})
        with bar(f"recording {name}") as step:
            found[name] = Experiment(preset=PRESET, readout=config).data(step)
    alike = [
        names for names in itertools.combinations(found, 2) if len({name.partition(":")[0] for name in names}) == 1
    ]
    return {
        "empty": {name: empty_bins(data) for name, data in found.items()},
        "rate_hz": {name: data.rate_hz for name, data in found.items()},
        "pairs": [{"first": a, "second": b} | likeness(found[a], found[b]) for a, b in alike],
    }


RESULT = Result("counts", compute)

if __name__ == "__main__":
    run("counts", RESULT)
