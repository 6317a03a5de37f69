"""Bit flips in the classifier: effects until the next scan, and effects that last until new weights are written."""

import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eskin.model.classifier.config import ClassifierConfig, highest, lowest
from eskin.model.classifier.file import neuron_image, weight_image
from eskin.model.classifier.network import IntegerNetwork
from eskin.model.classifier.run import first_ready, simulate
from eskin.model.classifier.words import packed
from eskin.rtl.classifier import core
from eskin.verify.faults.bench import NUMBER_BITS, bench_gates, channel_of, inside
from eskin.verify.faults.gates import last_clock, upset_runs
from eskin.verify.faults.outcomes import CHANGED, MOVED, NEVER, WRITTEN, UnlikeModel, Upset, classify_effects, since
from eskin.verify.faults.scenario import RESET

GOES_ON = ("class_valid", "event_ready")
"""Outputs that a working core raises within the last two bins of a scan."""
BINS = (7, 3, 3)
"""Time bins of the three scans: flops are flipped in the first scan, and weights are loaded again before the last."""
UPSET_BINS = 3
"""Bins in which flops are flipped."""
MEMORY = re.compile(r"(inputs|recurrent|neurons|parameters)\.memory")
"""Names of flops that store the weights from the host."""
WATCHED = ("event_ready", "class_valid", "class_index", "class_sure", "evidence", "overrun", "stall_count")
"""Outputs that are valid in every clock, if the core has them.

Other outputs are valid while ``hidden_valid`` or ``output_valid`` is high.
"""


@dataclass(frozen=True)
class Scans:
    """Stimulus of a classifier: three scans."""

    network: IntegerNetwork
    inputs: dict[str, NDArray[np.uint8]]  # for the gates, shape (clocks, bits), reset first
    # clocks of ``scan_start``, and those behind the last of each scan
    starts: list[int]
    ends: list[int]


def upsets(config: ClassifierConfig, stride: int, flops: str) -> Iterator[Upset]:
    """Flip every flop of a classifier in every clock of several bins, one per run; yield the outcomes.

    An outcome is "others moved" where all classes and evidences of the scan are right, if at other clocks or from other
    potentials, and "others changed" where they are not, and the next scan is right in every output and clock. It is
    "until written" where only a scan with weights loaded anew is, or where the core waits for a scan to begin. See
    ``eskin.verify.faults.outcomes.upsets``.
    """
    gates, what = bench_gates(core.Classifier(config)), _scans(config)
    expected = _expected(config, what)
    first = what.starts[0] + 1
    clocks = range(first, first + UPSET_BINS * config.clocks_per_bin, stride)
    scans = [slice(first_ready(config, start) + 1, end) for start, end in zip(what.starts, what.ends, strict=True)]
    late = slice(what.ends[0] - 2 * config.clocks_per_bin, what.ends[0])
    for part, outputs in upset_runs(gates, what.inputs, clocks, inside(gates, flops)):
        if [_bins(outputs, scan, 0) for scan in scans] != expected:
            raise UnlikeModel("the gates of the classifier do not give the model's classes")
        differs = np.logical_or.reduce([values != values[:, :1] for values in _seen(outputs)])
        last = last_clock(differs)
        right, *found = ([one[1:] for one in _bins(outputs, scans[0], run)] for run in range(len(part) + 1))
        stays, never = (np.logical_or.reduce(differs[scan]) for scan in scans[1:])
        stops = ~np.logical_and.reduce([(outputs[name][late] != 0).any(axis=0) for name in GOES_ON])
        last, never, stays, stops = (of_runs[1:] for of_runs in (last, never, stays, stops))
        changed = np.array([values != right for values in found])
        effects = {NEVER: never, WRITTEN: stays | stops, CHANGED: changed, MOVED: last >= 0}
        may_stay = np.array([MEMORY.match(name) is not None for _, name in part]) & ~stops
        yield from classify_effects(part, effects, "classifier.", other_clocks=since(part, last), may_stay=may_stay)


def _seen(outputs: dict[str, NDArray[np.int64]]) -> list[NDArray[np.int64]]:
    """Return all outputs, with 0 for invalid ones."""
    seen = [outputs[name] for name in WATCHED if name in outputs]
    for kind in ("hidden", "output"):
        valid = outputs[f"{kind}_valid"]
        names = (f"{kind}_{what}" for what in ("index", "potential", "spike"))
        seen += [valid, *(outputs[name] * valid for name in names if name in outputs)]
    return seen


def _bins(outputs: dict[str, NDArray[np.int64]], scan: slice, run: int) -> list[tuple[int, int, int]]:
    """Return clock, class and evidence of every bin of a scan in a run."""
    clocks = scan.start + np.flatnonzero(outputs["class_valid"][scan, run])
    found = (outputs[name][clocks, run].tolist() for name in ("class_index", "evidence"))
    return list(zip(clocks.tolist(), *found, strict=True))


def _scans(config: ClassifierConfig) -> Scans:
    """Return three scans of a random network."""
    rng = np.random.default_rng(0)
    network = IntegerNetwork.filled(config, lambda bits, *shape: rng.integers(lowest(bits), highest(bits) + 1, shape))
    images = [(0, weight_image(network)), (1, neuron_image(network))]
    words = [(1, neurons, address, word) for neurons, image in images for address, word in enumerate(image)]
    load: list[tuple[int, ...]] = []  # of every clock: valid, neurons, address, data
    starts, ends = [], []
    for number, bins in enumerate(BINS):
        load += [*words, (0,) * 4, (0,) * 4] if number != 1 else []
        starts.append(RESET + len(load))
        load += [(0,) * 4] * (bins * config.clocks_per_bin + 1)
        ends.append(RESET + len(load))
    load = [(0,) * 4] * RESET + load
    clock = np.arange(len(load))
    offer = np.zeros(len(load), bool)
    for start, end in zip(starts, ends, strict=True):
        busy = (clock > start) & (clock < end - config.clocks_per_bin)
        offer |= busy & (rng.random(len(load)) < 0.25)
    columns = dict(zip(("load_valid", "load_neurons", "load_address", "load_data"), np.array(load).T, strict=True))
    widths = core.Classifier(config).signature.members
    inputs = {
        "rst": clock[:, None] < RESET,
        "offer": offer[:, None],
        "scan_start": np.isin(clock, starts)[:, None],
        **{name: values[:, None] >> np.arange(widths[name].shape) & 1 for name, values in columns.items()},
    }
    return Scans(network, {name: bits.astype(np.uint8) for name, bits in inputs.items()}, starts, ends)


def _expected(config: ClassifierConfig, what: Scans) -> list[list[tuple[int, int, int]]]:
    """Return clock, class and evidence of every bin of each scan from the golden model."""
    offers = np.flatnonzero(what.inputs["offer"]).tolist()
    expected: list[list[tuple[int, int, int]]] = []
    for start, end in zip(what.starts, what.ends, strict=True):
        events = [
            (clock + 1 - start, channel_of(number % (1 << NUMBER_BITS), config.inputs))
            for number, clock in enumerate(offers)
            if start < clock < end
        ]
        bins = range(config.clocks_per_bin, end - start, config.clocks_per_bin)
        run = simulate(what.network, events, bins, end - start, start=0)
        assert any(one.spikes.any() for one in run.bins), "no neuron fires"
        expected.append([])
        for clock, one in zip(run.valid, run.bins, strict=True):
            evidence = packed(one.evidence, config.evidence_bits)
            if start + clock < end:
                expected[-1].append((start + clock, one.winner, evidence))
    return expected
