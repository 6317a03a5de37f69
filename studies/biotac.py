"""Slides of a BioTac over 20 materials: all readouts at equal data rate, with and without the level of the signal.

The recordings have no licence, so the project does not contain them. Fetch them beside the project:
``git clone https://github.com/dexrob/BioTac_slide_20_50 ../BioTac_slide_20_50``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from eskin.base.progress import bar
from eskin.base.workers.engine import Pool
from eskin.model.config import ReadoutConfig
from eskin.model.encoders import registry
from eskin.skin.recordings.event_files import kept_events, signals_of
from eskin.skin.recordings.options import Baseline, Preparation
from eskin.snn.data.bins import BinConfig
from eskin.snn.data.frame_steps import FrameSteps
from eskin.snn.encoder_choice import EncoderChoice
from eskin.snn.experiments.experiment import Experiment
from eskin.snn.experiments.recipes import epochs_for, for_recordings
from eskin.snn.experiments.settings import experiment_of
from eskin.snn.experiments.sweep import NEEDS
from studies.study import Data, Result, run, work_of
from studies.tasks import SEEDS, TRIED, UPDATES, Readout, Trainings, compared, rate_of, references_of

RECORDINGS = Path("../BioTac_slide_20_50/raw_data")
"""Class folders of the published recordings."""

ELECTRODES = "27-45"
"""Columns of the 19 electrodes; the pressure sensor and the temperature are left out."""
TESTS = "*_[45]?_bio*"
"""The last 11 of the 50 slides over each material."""
RATE_HZ, SECONDS = 100.0, 4.0

BUDGETS_BPS = (1000, 3000)
"""Data rates: of each encoder, the resolution with the nearest data rate counts."""
BASELINES: tuple[Baseline, ...] = ("fixed", "first")
"""The level of each slide is kept, or removed with its first value."""
BIN_S = 0.04


@dataclass(frozen=True)
class Slides(Readout):
    """A readout of the recordings with a baseline."""

    baseline: Baseline

    @property
    def config(self) -> ReadoutConfig:
        """Return the readout; of frames, one that keeps the samples."""
        encoding, bits = ("lcs", 6) if self.kind == "frame" else (self.kind, int(self.text.partition(":")[2]))
        array = ReadoutConfig(rows=1, columns=19, sample_rate_hz=RATE_HZ)
        return array.replace(encoding=encoding, resolution=bits)

    def events(self, place: Path) -> Path:
        """Return the folder of event files; the training recordings alone set scale and constants."""
        options = Preparation(taxel_columns=ELECTRODES, baseline=self.baseline, scale="per-taxel")
        given = {"encoding", "resolution", "scale", "baseline", "rows", "columns", "sample_rate_hz"}
        return kept_events(place, options, self.config, given, fit=EncoderChoice(test=TESTS))[0]

    def experiment(self, place: Path) -> Experiment:
        """Return the training: that of ``eskin train`` with learned decays, equal for all readouts."""
        frames = self.text if self.kind == "frame" else None
        step_s = FrameSteps.parse(frames, BIN_S).step_s if frames else BIN_S
        count = len(list(place.glob("*/*"))) * 39 // 50
        follows = for_recordings("skin", np.full(count, SECONDS), step_s) | {"learn_decay": True}
        epochs = epochs_for(count, follows.get("windows", 1), follows["batch"], UPDATES)
        bins, events = BinConfig(bin_s=BIN_S), str(self.events(place))
        return experiment_of("skin", follows, epochs, bins, frames, events=events, tests=(TESTS,))


def readouts_of(baseline: Baseline, place: Path) -> dict[int, list[Slides]]:
    """Return for each data rate the resolution of every encoder that is nearest in data rate, first of N-LCS."""
    codes, _ = signals_of(Slides("biotac", "nlcs:8", baseline).events(place))
    some = [codes[name] for name in sorted(codes)[::20]]
    tried = [Slides("biotac", f"{kind}:{bits}", baseline) for kind in registry.NAMES for bits in TRIED]
    apart = {one: math.log(max(rate_of(one.config, some), 1)) for one in tried}

    def nearest(kind: str, budget_bps: int) -> Slides:
        own = (one for one in tried if one.kind == kind)
        return min(own, key=lambda one: abs(apart[one] - math.log(budget_bps)))

    kinds = sorted(registry.NAMES, key=lambda kind: kind != "nlcs")
    return {budget: [nearest(kind, budget) for kind in kinds] for budget in BUDGETS_BPS}


def compute(pool: Pool) -> Data:
    """Return points of all readouts with both baselines, the frames that were tried, and plain references."""
    store, levels = work_of("biotac", NEEDS), {}
    for baseline in BASELINES:
        readouts = readouts_of(baseline, RECORDINGS)
        with bar(f"trainings, {baseline}") as step:
            points, inner = compared(Trainings(store, pool, RECORDINGS, step), readouts)
        levels[baseline] = {"points": points, "inner": inner}
    plain = references_of(Slides("biotac", "nlcs:8", "fixed").experiment(RECORDINGS))
    return {"seeds": SEEDS, "labels": plain.pop("labels"), "references": plain, "levels": levels}


RESULT = Result("biotac", compute, long=True, needs=NEEDS)

if __name__ == "__main__":
    run("biotac", RESULT)
