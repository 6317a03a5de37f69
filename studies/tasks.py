"""Two tasks of the INTUITIVE chip, generated: frequency of a vibration (flutter), and period of slow indentations.

The authors' scripts (https://github.com/mdalea/intuitive) state classes, recordings, bits and network. Everything else
is ours, chosen before the first training: frequencies and periods, depths, mechanics, disturbances and noise.

The recordings are written as a user has them: ``eskin train --data out/studies/tasks/flutter`` reads them.
"""

from __future__ import annotations

import dataclasses
import math
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from eskin.base.figures.style import dress, legend_below, new_figure, save_figure
from eskin.base.files import digest, read_json
from eskin.base.progress import bar
from eskin.base.workers.engine import Pool, each
from eskin.base.workers.store import Store
from eskin.model.config import ReadoutConfig
from eskin.model.encoders import registry
from eskin.model.taxel import encode_timed
from eskin.skin.figures.readouts import FRAME, look
from eskin.skin.recordings.event_files import kept_events, signal_statistics, signals_of
from eskin.skin.recordings.fitting import with_seconds
from eskin.skin.recordings.options import Preparation
from eskin.skin.recordings.quality import MAX_CLOCKS
from eskin.skin.textures.physical import PhysicalScan
from eskin.skin.textures.presets import quantise
from eskin.snn.data.bins import BinConfig
from eskin.snn.data.folds import inner_part
from eskin.snn.data.frame_steps import FrameSteps
from eskin.snn.data.scans import Split
from eskin.snn.experiments.experiment import Experiment
from eskin.snn.experiments.intervals import bootstrap
from eskin.snn.experiments.pairs import right_of
from eskin.snn.experiments.points import as_word
from eskin.snn.experiments.recipes import epochs_for, for_recordings
from eskin.snn.experiments.settings import experiment_of
from eskin.snn.experiments.single import Fold
from eskin.snn.experiments.sweep import NEEDS
from eskin.snn.reference import logistic_classes, references
from studies.drawing import draw_accuracies
from studies.study import OUT, Data, Result, run, work_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Signal = NDArray[np.float64]

# -- the skin, equal for both tasks

SKIN, PITCH_M = (12, 16), 200e-6
"""Rows and columns of the INTUITIVE chip, and the distance of its taxels."""
EVERY = 4
"""Every fourth taxel of a row and a column is read: 3 x 4 taxels."""
FULL_SCALE_MM = 0.75
"""Displacement of the skin's surface at which a taxel below it is at full scale."""
DEPTH_MM = (0.05, 0.5)
"""Amplitude of a vibration and depth of an indentation: from a tenth of the largest on, evenly in the logarithm."""
CONTACT_M, OFF_CENTRE_M = 1e-3, 0.5e-3
"""Standard deviation of the displacement around the tip, and largest distance of the tip from the middle, per axis."""
GAINS = 0.1
"""Standard deviation of the gains of the taxels; training and test use the same skin."""
UNSTEADY_MM, UNSTEADY_HZ = 0.02, 12.0
"""Unsteadiness of the tip: root mean square, and the frequency below which it lies, as a tremor of the hand."""
NOISE = 10e-3
"""White noise of a sample, rms in full scales: the largest of the paper's Fig. 6, where its model prefers events."""
REST_S = 1.0
"""Time before a recording, in which the sensor settles."""

# -- the classes

FLUTTER_HZ = (20, 24, 29, 35, 42, 50)
"""Six frequencies in the range of flutter (5 to 50 Hz), each about 20 % above the one before."""
TUNING = 0.03
"""Standard deviation of the frequency of a recording, as a share of that of its class."""
PERIODS_MS = (250, 350, 500, 710, 1000)
"""Five periods of indentation up to the longest in the authors' scripts, 1000 ms; their shortest, 50 ms, is flutter."""
UNEVEN, DUTY, RAMP_S = 0.1, (0.4, 0.6), (0.02, 0.06)
"""Standard deviation of period and depth from press to press, share of the period in which the tip is down, and
duration of its way down or up."""

LEARNED, TESTED = 40, 40
"""Recordings of a class for training, as the authors have, and for the test."""

# -- readouts and training

BUDGETS = (3, 4, 2)
"""Bits of LCS; the other readouts are compared at its data rate. The chip has 3 to 5 bits."""
TRIED = range(2, 11)
"""Bits that are tried for the other encoders."""
ALIKE = 1.6
"""Readouts at equal data rate differ by less than this factor."""
FRAME_BITS = (3, 5, 8)
"""Bits of the frames among which inner validation chooses, all at the data rate of LCS."""
UPDATES, SEEDS = 1200, 3
"""Updates of the weights in a training, and seeds."""
PLAYED = (3, ("lcs", "nlcs"))
"""Budget and encoders of the networks that the RTL plays, with seed 0."""
TESTS = "*/test_*"
SPECTRUM_LINES = 64
"""Lines of the spectrum of a whole recording, the first of which is one period; a reference sees them."""


@dataclass(frozen=True)
class Kind:
    """A task: its classes and recordings."""

    name: str
    title: str
    classes: tuple[int, ...]
    unit: str
    rate_hz: float
    """Samples per second."""
    seconds: float
    bin_s: float
    """Time bin of the events."""
    displacement: Callable[[np.random.Generator, int, Signal], Signal]
    """Returns the displacement of the tip in mm at times in seconds, for a class."""


def vibration(random: np.random.Generator, hz: int, time_s: Signal) -> Signal:
    """Return a sine of random amplitude and phase, near the frequency of a class."""
    amplitude_mm = math.exp(random.uniform(*np.log(DEPTH_MM)))
    own_hz = hz * (1 + TUNING * random.standard_normal())
    return np.asarray(amplitude_mm * np.sin(2 * np.pi * (own_hz * time_s + random.uniform())))


def presses(random: np.random.Generator, period_ms: int, time_s: Signal) -> Signal:
    """Return presses of random depth, duration and start, about one in every period of a class."""
    depth_mm, down, ramp_s = math.exp(random.uniform(*np.log(DEPTH_MM))), random.uniform(*DUTY), random.uniform(*RAMP_S)
    found, period_s = np.zeros(len(time_s)), period_ms / 1000
    begin_s = time_s[0] - random.uniform() * period_s
    while begin_s < time_s[-1]:
        uneven, deep = np.clip(1 + UNEVEN * random.standard_normal(2), 0.5, 1.5)
        up_s = begin_s + down * period_s * uneven
        shape = np.minimum(time_s - begin_s, up_s + ramp_s - time_s) / ramp_s
        found = np.maximum(found, depth_mm * deep * np.clip(shape, 0, 1))
        begin_s += period_s * uneven
    return found


KINDS = {
    kind.name: kind
    for kind in (
        Kind("flutter", "vibration frequency", FLUTTER_HZ, "Hz", 500.0, 0.4, 0.004, vibration),
        Kind("indentation", "period of slow indentation", PERIODS_MS, "ms", 250.0, 4.0, 0.02, presses),
    )
}


def recording(kind: Kind, number: int, label: int, test: bool) -> NDArray[np.float32]:
    """Return the outputs of the taxels for one recording of a class, in full scales, shape (ticks, rows, columns)."""
    from scipy.signal import butter, sosfilt

    random = np.random.default_rng([list(KINDS).index(kind.name), label, test, number])
    before, ticks = round(REST_S * kind.rate_hz), round(kind.seconds * kind.rate_hz)
    time_s = np.arange(-before, ticks) / kind.rate_hz
    tip_mm = kind.displacement(random, kind.classes[label], time_s)
    tremor = sosfilt(butter(2, UNSTEADY_HZ, fs=kind.rate_hz, output="sos"), random.standard_normal(len(time_s)))
    tip_mm = tip_mm + UNSTEADY_MM * tremor / tremor.std()
    share = _shares(random)
    signal = PhysicalScan().sensor(256.0 * tip_mm[:, None] * share / FULL_SCALE_MM, kind.rate_hz)[before:]
    noisy = signal + NOISE * random.standard_normal(signal.shape)
    return np.asarray(noisy.reshape(ticks, SKIN[0] // EVERY, SKIN[1] // EVERY), np.float32)


def _shares(random: np.random.Generator) -> Signal:
    """Return the share of the tip's displacement that each taxel gives, for a random place of the tip."""
    at = [(np.arange(EVERY // 2 - 1, side, EVERY) - (side - 1) / 2) * PITCH_M for side in SKIN]
    near = [np.exp(-(((one - random.uniform(-OFF_CENTRE_M, OFF_CENTRE_M)) / CONTACT_M) ** 2) / 2) for one in at]
    gains = 1 + GAINS * np.random.default_rng(0).standard_normal((len(at[0]), len(at[1])))
    return np.asarray((np.outer(*near) * gains).ravel())


def write_recordings(kind: Kind, folder: Path) -> Path:
    """Write all recordings of a task as NumPy arrays in class folders, and return their folder."""
    place = folder / kind.name
    for label, value in enumerate(kind.classes):
        (place / f"{value:04}{kind.unit}").mkdir(parents=True, exist_ok=True)
        for test, count in ((False, LEARNED), (True, TESTED)):
            for number in range(count):
                name = f"{value:04}{kind.unit}/{'test' if test else 'learn'}_{number:02}.npy"
                np.save(place / name, recording(kind, number, label, test))
    return place


# -- readouts


@dataclass(frozen=True)
class Readout:
    """An encoder and its resolution, or frames as in ``FrameSteps.parse``."""

    task: str
    text: str

    @property
    def kind(self) -> str:
        """Name of the encoder, or ``frame``."""
        name = self.text.partition(":")[0]
        return FRAME if name.startswith(FRAME) else name

    @property
    def config(self) -> ReadoutConfig:
        """Return the readout; of frames, one that keeps the samples."""
        encoding, bits = ("lcs", 4) if self.kind == FRAME else (self.kind, int(self.text.partition(":")[2]))
        rows, columns = (side // EVERY for side in SKIN)
        array = ReadoutConfig(rows=rows, columns=columns, sample_rate_hz=KINDS[self.task].rate_hz)
        return array.replace(encoding=encoding, resolution=bits)

    def experiment(self, place: Path) -> Experiment:
        """Return the training: that of ``eskin train`` with learned decays, equal for all readouts.

        The recordings are encoded without a baseline, at the full scale of the skin.
        """
        given = {"encoding", "resolution", "sample_rate_hz", "scale", "baseline"}
        events = kept_events(place, Preparation(baseline="none", scale="1"), self.config, given)[0]
        kind, frames = KINDS[self.task], self.text if self.kind == FRAME else None
        step_s = FrameSteps.parse(frames, kind.bin_s).step_s if frames else kind.bin_s
        count = LEARNED * len(kind.classes)
        follows = for_recordings("skin", np.full(count, kind.seconds), step_s) | {"learn_decay": True}
        epochs = epochs_for(count, follows.get("windows", 1), follows["batch"], UPDATES)
        bins = BinConfig(bin_s=kind.bin_s)
        return experiment_of("skin", follows, epochs, bins, frames, events=str(events), tests=(TESTS,))

    def frames(self, bits_per_s: float) -> list[Self]:
        """Return the frames that are tried at a data rate, at most as fast as the samples."""
        found, config = [], self.config
        for bits in FRAME_BITS:
            rate_hz = min(bits_per_s / (config.taxels * bits), config.sample_rate_hz)
            found.append(dataclasses.replace(self, text=f"frame:{rate_hz:.4g}:{bits}"))
        return found

    def bits_per_s(self, rate_hz: float) -> float:
        """Return the data rate for a rate of events or frame values."""
        return rate_hz * (int(self.text.split(":")[2]) if self.kind == FRAME else self.config.event_bits)


def encoders_of(task: str, place: Path) -> dict[int, list[Readout]]:
    """Return for each budget LCS, and of every other encoder the resolution with the nearest data rate, if alike."""
    files = sorted(place.glob("*/learn_*.npy"))[::4]
    recordings = [quantise(np.load(file).reshape(-1, Readout(task, "lcs:4").config.taxels), 12)[0] for file in files]

    rates = {
        readout: rate_of(readout.config, recordings)
        for kind in registry.NAMES
        for readout in (Readout(task, f"{kind}:{bits}") for bits in (BUDGETS if kind == "lcs" else TRIED))
    }
    found = {}
    for budget in BUDGETS:
        lcs = Readout(task, f"lcs:{budget}")
        apart = {one: abs(math.log(max(rate, 1) / rates[lcs])) for one, rate in rates.items()}
        others = [min((one for one in rates if one.kind == kind), key=apart.__getitem__) for kind in registry.NAMES[1:]]
        found[budget] = [lcs, *(one for one in others if apart[one] < math.log(ALIKE))]
    return found


def rate_of(config: ReadoutConfig, recordings: Sequence[NDArray[np.int32]]) -> float:
    """Return the mean data rate of recordings in bit/s, with the leak that ``eskin train`` takes."""
    config = with_seconds(config.replace(clocks_per_sample=MAX_CLOCKS), ())
    events = sum(int(np.abs(encode_timed(config, codes)[0].astype(np.int64)).sum()) for codes in recordings)
    return events * config.event_bits * config.sample_rate_hz / sum(map(len, recordings))


# -- trainings


def trained(experiment: Experiment, seed: int, inner: bool) -> dict[str, Any]:
    """Return labels and predictions of the test recordings, or of an inner validation part of the others."""
    import torch

    from eskin.snn.train import predicted_classes, train

    torch.set_num_threads(1)
    data = experiment.data()
    fold = Fold.named(data, *experiment.tests)
    learned, judged = fold.images, fold.test
    if inner:
        judged = inner_part(data.image_labels, learned, seed)
        learned = np.setdiff1d(learned, judged)
    network = train(Split(data, learned), experiment.network_config(data), experiment.train, seed).network
    words = as_word(data.image_labels[judged]), as_word(predicted_classes(network, data, judged))
    return {"labels": words[0], "predicted": words[1], "rate_hz": data.rate_hz}


class Trainings:
    """Results of trainings, stored so that a stopped run can continue."""

    def __init__(self, store: Store, pool: Pool, place: Path, step: Callable[[], object]) -> None:
        self._store, self._pool, self._place, self._step = store, pool, place, step

    def of(self, readouts: Sequence[Readout], seeds: int, inner: bool = False) -> list[list[dict[str, Any]]]:
        """Return the results of every readout, one for each seed."""
        experiments = [readout.experiment(self._place) for readout in readouts]
        jobs = [(experiment, seed, inner) for experiment in experiments for seed in range(seeds)]
        found = []
        for one in each(self._pool, trained, jobs, store=self._store, name=_name):
            found.append(one)
            self._step()
        return [found[at : at + seeds] for at in range(0, len(found), seeds)]


def _name(experiment: Experiment, seed: int, inner: bool) -> str:
    return f"{digest(experiment.to_dict())}/{seed}{'/inner' * inner}"


def point_of(readout: Readout, budget: int, results: Sequence[dict[str, Any]]) -> Data:
    """Return data rate, accuracy and predictions of a readout."""
    labels, words = results[0]["labels"], [one["predicted"] for one in results]
    right = right_of(labels, words).astype(float)
    return {
        "readout": readout.text,
        "kind": readout.kind,
        "budget": budget,
        "rate_hz": results[0]["rate_hz"],
        "bits_per_s": readout.bits_per_s(results[0]["rate_hz"]),
        "accuracy": float(right.mean()),
        "bootstrap_95": bootstrap(right.T),
        "predicted": words,
    }


def references_of(experiment: Experiment) -> dict[str, str]:
    """Return the test predictions of plain classifiers of the signals by name, and the labels."""
    data, folder = experiment.data(), Path(str(experiment.events))
    fold, labels = Fold.named(data, *experiment.tests), data.image_labels
    found = references(data, fold.images, fold.test, signal_statistics(folder, data.names))
    codes, _ = signals_of(folder)
    lines = np.array([_spectrum(codes[name]) for name in data.names])
    words = {name: as_word(one["predicted"]) for name, one in found.items() if name != "events"}
    return words | {
        "labels": as_word(labels[fold.test]),
        "spectrum": as_word(logistic_classes(lines, labels, fold.images, fold.test)),
    }


def _spectrum(codes: NDArray[np.int32]) -> Signal:
    """Return the logarithm of the power of the first lines of a recording, summed over the taxels."""
    power = np.abs(np.fft.rfft(codes - codes.mean(0), axis=0)[1 : SPECTRUM_LINES + 1]) ** 2
    return np.asarray(np.log(power.sum(1) + 1))


# -- the RTL chip


def played(task: str, place: Path, readout: Readout) -> Data:
    """Train a network by the command ``train``, quantise it, play all test recordings through the RTL chip.

    The network is that of seed 0.
    """
    kind, out = KINDS[task], OUT / "tasks" / f"{task}-{readout.kind}"
    encoding, bits = readout.text.split(":")
    commands = [
        f"train --data {place} --test {TESTS} --sample-rate {kind.rate_hz:g} --encoding {encoding} --resolution {bits} "
        f"--baseline none --scale 1 --bin {kind.bin_s:g} --set learn_decay=true "
        f"--epochs {readout.experiment(place).train.epochs} --out {out}",
        f"quantise {out}/weights.npz",
        f"touch --data {place} --weights {out}/whole.npz --out {out}/touch --workers 1",
    ]
    for command in commands:
        subprocess.run([sys.executable, "-m", "eskin", *command.split()], check=True)
    found = read_json(out / "touch" / place.name / "summary.json", "the result of touch", dict)
    names = ("images", "right", "right_float", "events", "mismatches", "stalls", "clocks")
    answers = sorted(found["answers"].items())
    classes = [f"{value:04}{kind.unit}" for value in kind.classes]
    said = {"commands": [f"eskin {command}" for command in commands]} | {name: found[name] for name in names}
    return said | {"predicted": as_word(classes.index(one["class"]) for _, one in answers)}


# -- the study


def compute(pool: Pool) -> Data:
    """Return points, frames that were tried, references and RTL results of both tasks."""
    store, tasks = work_of("tasks", NEEDS), {}
    for name, kind in KINDS.items():
        place = write_recordings(kind, OUT / "tasks")
        readouts = encoders_of(name, place)
        with bar(f"trainings, {name}") as step:
            points, inner = compared(Trainings(store, pool, place, step), readouts)
        plain = references_of(readouts[BUDGETS[0]][0].experiment(place))
        tasks[name] = {"classes": [f"{value} {kind.unit}" for value in kind.classes], "points": points, "inner": inner}
        tasks[name] |= {"labels": plain.pop("labels"), "references": plain}
        budget, kinds = PLAYED
        tasks[name]["chips"] = {one.text: played(name, place, one) for one in readouts[budget] if one.kind in kinds}
    return {"tasks": tasks}


def compared(
    runs: Trainings, readouts: Mapping[int, Sequence[Readout]], seeds: int = SEEDS
) -> tuple[list[Data], list[Data]]:
    """Return the points of all readouts and of the best frames, and the inner validation of all frames.

    The frames have the data rate of the first readout.
    """
    points, inner = [], []
    for budget, own in readouts.items():
        some = [point_of(one, budget, got) for one, got in zip(own, runs.of(own, seeds), strict=True)]
        tried = own[0].frames(some[0]["bits_per_s"])
        judged = [point_of(one, budget, got) for one, got in zip(tried, runs.of(tried, 1, True), strict=True)]
        best = max(range(len(tried)), key=lambda number: judged[number]["accuracy"])
        inner += [one | {"chosen": number == best} for number, one in enumerate(judged)]
        (got,) = runs.of([tried[best]], seeds)
        points += [*some, point_of(tried[best], budget, got)]
    return points, inner


def plot_tasks(data: Data, path: Path) -> None:
    """Plot one recording of each task, and accuracy against data rate."""
    figure = new_figure(9.0, 5.6, "Two generated tasks of the INTUITIVE chip: accuracy against data rate")
    grid = figure.subplots(2, 2, height_ratios=(1, 2))
    for (above, below), (name, task) in zip(grid.T, data["tasks"].items(), strict=True):
        kind = KINDS[name]
        label = len(kind.classes) // 2
        signal = recording(kind, 0, label, True)
        dress(above, f"a recording, {task['classes'][label]}", "s", "full scales" if name == "flutter" else "")
        above.plot(np.arange(len(signal)) / kind.rate_hz, signal.reshape(len(signal), -1), lw=0.7, color="#0072b2")
        dress(below, f"{kind.title}, {len(kind.classes)} classes", "data rate (kb/s)", "accuracy (%)")
        _draw(below, task["points"])
        best = max(np.mean(right_of(task["labels"], [word])) for word in task["references"].values())
        below.axhline(100 * best, color="#555555", lw=0.8, ls=":", label="best plain classifier of the signals")
    legend_below(figure, grid[1][0].get_legend_handles_labels(), 3, "bars: 95 % interval over recordings and seeds")
    save_figure(figure, path)


def _draw(panel: Axes, points: Sequence[Data]) -> None:
    """Draw the accuracies of every readout over its data rate."""
    from matplotlib.ticker import NullFormatter

    for kind in dict.fromkeys(point["kind"] for point in points):
        own = sorted((point for point in points if point["kind"] == kind), key=lambda point: point["bits_per_s"])
        style = {"color": look(kind).colour, "marker": look(kind).marker, "label": look(kind).title}
        draw_accuracies(panel, [1e-3 * point["bits_per_s"] for point in own], own, style, markersize=5, lw=1.2)
    panel.set_xscale("log")
    panel.xaxis.set_major_formatter("{x:g}")
    panel.xaxis.set_minor_formatter(NullFormatter())


RESULT = Result("tasks", compute, plot_tasks, long=True, needs=NEEDS)

if __name__ == "__main__":
    run("tasks", RESULT)
