"""Noise and power: accuracy, event rate and power of trained networks against the AFE noise v_n, in both power modes.

The scans of the test images are recorded again with noise at the outputs of the AFE. The resulting events feed the
power model, so that accuracy, rate and power belong to the same v_n. The study tests the networks in
``out/train*/NETWORK/TRAINING``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from eskin.base.figures.labels import Box, Taken, on_page, place_label
from eskin.base.figures.style import GREY, dress, legend_below, new_figure, plain_numbers, save_figure
from eskin.base.progress import bar
from eskin.base.workers.engine import Pool
from eskin.model.address_events import taxel_of
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.power.equations import CORRECTIONS, FloatArray, PowerModel, TaxelRates
from eskin.power.parameters import PowerParameters
from eskin.power.readouts import Readout, equations_of
from eskin.skin.textures.dataset import open_dataset
from eskin.skin.textures.scan import quantise
from eskin.snn.data.bins import counted_from
from eskin.snn.data.disturb import SLOW_HZ, noisy
from eskin.snn.data.frames import frame_data, sampled_config, values_of
from eskin.snn.data.record import recorded, said_of
from eskin.snn.data.scans import ScanData, collect
from eskin.snn.exchange.weights import config_of
from eskin.snn.experiments.experiment import Experiment
from eskin.snn.experiments.sweep import NEEDS
from studies.drawing import draw_networks, network_styles
from studies.networks import Cells, Subject, all_pairs, by_case, in_words, score_of, tested, trained_networks
from studies.study import Data, Result, run, work_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Mode = Literal["paper", "consistent"]
MODES: tuple[Mode, ...] = get_args(Mode)

POLE_HZ: dict[Mode, float | None] = {"paper": None, "consistent": SLOW_HZ}
"""Bandwidth of the noise in each mode: 10 kHz (white for these readouts), and the bandwidth of the textures."""

CORRECTED: dict[Mode, frozenset[str]] = {"paper": frozenset({"event_rates"}), "consistent": frozenset(CORRECTIONS)}
"""Corrections of each mode: only the event rates with noise, or all corrections."""

NOISES_V = (1e-4, 1e-3, 3e-3, 1e-2, 2e-2)

Noise = tuple[Mode, float]
"""Mode, and rms of the AFE noise in volts."""


def compute(pool: Pool) -> Data:
    """Return accuracy, rate and power of every network at every noise, and comparisons of every two networks."""
    subjects = trained_networks()
    with bar("networks", len(subjects)) as step:
        jobs = [([subject], {"noises_v": list(NOISES_V)}) for subject in subjects]
        cells = tested(pool, work_of("noise_power", NEEDS), answers, jobs, step)
    points = points_of(subjects, cells)
    return {"points": points, "pairs": all_pairs(points, ("mode", "noise_v"))}


def noisy_codes(noise: Noise, config: ReadoutConfig, signals: NDArray[np.float64], image: int) -> NDArray[np.int32]:
    """Return the codes of a scan with noise, equal for all networks with the same samples."""
    mode, noise_v = noise
    generator = np.random.default_rng([MODES.index(mode), round(1e7 * noise_v), image])
    pole_hz = POLE_HZ[mode]
    pole = None if pole_hz is None else pole_hz / config.sample_rate_hz
    return quantise(noisy(signals, noise_v, generator, pole), config.sample_bits)[0]


TITLES = {
    "paper": "published equations, noise up to 10 kHz",
    "consistent": "all corrections, noise below 97 Hz",
}


@dataclass(frozen=True)
class Rates:
    """Event rates at one noise level, as a ``RateSource`` of the power model."""

    population_hz: float
    square_sum_hz2: float

    def taxel_rates(self, readout: Readout, resolution: FloatArray, tau_s: FloatArray, taxels: int) -> TaxelRates:
        """Return the measured rates, independent of resolution and time constant."""
        ones = np.ones_like(resolution * tau_s)
        return TaxelRates(self.population_hz * ones, self.square_sum_hz2 * ones)


def noisy_scans(experiment: Experiment, images: Sequence[int], noises: Sequence[Noise]) -> list[tuple[ScanData, Rates]]:
    """Return the network inputs for images at every noise level, and the event rates."""
    scan, config = experiment.scan_and_config()
    dataset, frames = open_dataset(experiment.dataset), experiment.frames
    if frames is not None:
        config = sampled_config(frames, config)
    found: list[list[Any]] = [[] for _ in noises]
    for image in images:
        texture = dataset[int(image)]
        signals = scan.signals(config, texture.load())
        for noise, kept in zip(noises, found, strict=True):
            codes = noisy_codes(noise, config, signals, int(image))
            said = said_of(texture, dataset.name, scan)
            kept.append(values_of(frames, codes) if frames is not None else recorded(config, codes, said))
    if frames is None:
        return [(collect(kept, experiment.bins, dataset.class_names), rates_of(kept)) for kept in found]
    textures = [dataset[int(image)] for image in images]
    places = range(len(textures))
    made = [frame_data(frames, textures, kept, places, dataset.class_names, config.taxels) for kept in found]
    return [(data, Rates(data.rate_hz, data.rate_hz**2 / config.taxels)) for data in made]


def rates_of(recordings: Sequence[Recording]) -> Rates:
    """Return the rates of the counted events, as sums over the taxels."""
    config = recordings[0].config
    of_taxels = np.zeros(config.taxels)
    for recording in recordings:
        events = recording.events[recording.events["t"] >= counted_from(recording)]
        of_taxels += np.bincount(taxel_of(events, config), minlength=config.taxels) / recording.duration_s
    of_taxels /= len(recordings)
    return Rates(float(of_taxels.sum()), float((of_taxels**2).sum()))


def answers(subjects: Sequence[Subject], case: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the answers of networks at every noise level."""
    return [_cell(subject, case["noises_v"]) for subject in subjects]


def _cell(subject: Subject, noises_v: Sequence[float]) -> dict[str, Any]:
    """Return predictions and event rates of one network at every noise level."""
    from eskin.snn.train import check_fits, logits_of

    noises = [(mode, noise_v) for mode in MODES for noise_v in noises_v]
    data = noisy_scans(subject.experiment, subject.images.tolist(), noises)
    network = subject.weights.network
    check_fits(config_of(network), data[0][0])
    answers = [
        {
            "mode": mode,
            "noise_v": noise_v,
            "predicted": logits_of(network, scans).argmax(1).tolist(),
            "population_hz": rates.population_hz,
            "square_sum_hz2": rates.square_sum_hz2,
        }
        for (mode, noise_v), (scans, rates) in zip(noises, data, strict=True)
    ]
    return {"labels": data[0][0].labels.tolist(), "answers": answers}


def points_of(subjects: Sequence[Subject], cells: Cells) -> list[dict[str, Any]]:
    """Return accuracy, intervals, rates and power for every network, mode and noise level."""
    experiments = {subject.network: subject.experiment for subject in subjects}
    found = []
    for case, parts in by_case([cell | one for cell in cells for one in cell["answers"]], "network", "mode", "noise_v"):
        means = {name: float(np.mean([cell[name] for cell in parts])) for name in ("population_hz", "square_sum_hz2")}
        experiment = experiments[case["network"]]
        found.append(
            {
                **case,
                "readout": experiment.kind,
                **score_of(parts),
                "rate_hz": means["population_hz"],
                "data_rate_bps": means["population_hz"] * experiment.bits_per_event,
                "power_w": power_of(experiment, case["mode"], case["noise_v"], Rates(**means)),
                "answers": in_words(parts),
            }
        )
    return found


def power_of(experiment: Experiment, mode: Mode, noise_v: float, rates: Rates) -> dict[str, float]:
    """Return power of AFE, converter and I/O and their total in watts.

    Encoders use the equations of ``eskin.power.readouts``. In mode ``paper`` frames cost 2 BW M samples per second,
    used or not; in mode ``consistent`` only the used samples count.
    """
    config = experiment.scan_and_config()[1]
    parameters = PowerParameters(rows=config.rows, columns=config.columns)
    if experiment.frames is not None:
        parameters = parameters.replace(signal_bandwidth_hz=experiment.frames.rate_hz / 2)
    readout: Readout = equations_of(experiment.readout.encoding) if experiment.frames is None else "frame"
    tau_s = config.tau_s if config.encoder.leaks else 0.2
    model = PowerModel(parameters=parameters, corrections=CORRECTED[mode], measured=rates)
    found = model.breakdown(readout, experiment.bits, noise_v, tau_s)
    return {name: float(getattr(found, name)) for name in ("afe", "converter", "io", "total")}


def plot_noise_power(data: Mapping[str, Any], path: Path) -> None:
    """Plot accuracy against power, one panel per mode of the power model; labels give the noise."""
    points = data["points"]
    figure = new_figure(11, 5.0, "Accuracy over total power of the readout; numbers beside points: AFE noise (mV rms)")
    axes = figure.subplots(1, len(TITLES), sharey=True)
    words_of = (str(digit) for point in points for cell in point["answers"] for digit in cell["labels"])
    classes = {1 + max(map(int, filter(str.isdigit, words_of)), default=-1)} - {0}
    for axis, (mode, title) in zip(axes, TITLES.items(), strict=True):
        dress(axis, f"{mode} mode: {title}", "total power (uW)")
        own = [point for point in points if point["mode"] == mode]
        draw_networks(axis, own, lambda point: 1e6 * point["power_w"]["total"], network_styles(points))
        axis.set_xscale("log")
        plain_numbers(axis)
        axis.set_ylim(0, 104)
        for guess in {100 / count for count in classes}:
            axis.axhline(guess, color=GREY, linestyle=":", linewidth=0.8)
    axes[0].set_ylabel("accuracy (%)", fontsize=8.5)
    words = "bars: 95 % interval over images and seeds; dotted: guessing"
    legend_below(figure, axes[0].get_legend_handles_labels(), 6, words, handlelength=3)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for axis, mode in zip(axes, TITLES, strict=True):
        _label_points(axis, [point for point in points if point["mode"] == mode])
    save_figure(figure, path)


def _label_points(axis: Axes, points: Sequence[Mapping[str, Any]]) -> None:
    """Write the noise beside each point, where it covers no other point or label."""
    styles = network_styles(points)
    where = [(1e6 * point["power_w"]["total"], 100 * point["accuracy"]) for point in points]
    pages = [on_page(axis, *at) for at in where]
    marks = [Box(x - 2.5, y - 2.5, x + 2.5, y + 2.5) for x, y in pages]
    taken = Taken(list(marks))
    for network in styles:
        taken.add_line([page for page, point in zip(pages, points, strict=True) if point["network"] == network])
    for point, at, mark in zip(points, where, marks, strict=True):
        colour = styles[point["network"]]["color"]
        note = axis.annotate(f"{1e3 * point['noise_v']:g}", at, (0, 0), textcoords="offset points", fontsize=6,
                             color=colour, arrowprops={"arrowstyle": "-", "lw": 0.5, "color": colour})  # fmt: skip
        place_label(axis, note, mark, taken, "right above left below")


RESULT = Result("classifier/noise_power", compute, plot_noise_power, long=True, needs=NEEDS)

if __name__ == "__main__":
    run("noise_power", RESULT)
