"""Choose encoder, resolution, baseline and scale of recordings by short trainings."""

import dataclasses
import math
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.model.cases import cases
from eskin.model.config import ReadoutConfig
from eskin.model.encoders import registry
from eskin.skin.recordings.event_files import bin_of_spectrum
from eskin.skin.recordings.fitting import Fit, with_seconds
from eskin.skin.recordings.folder import negative_part_lost
from eskin.skin.recordings.options import PER_TAXEL, Baseline, Preparation
from eskin.skin.recordings.prepare import at_gain
from eskin.skin.recordings.quality import MAX_CLOCKS
from eskin.snn.data.bins import BinConfig
from eskin.snn.data.folds import check_classes, matching, possible_folds, stratified_folds
from eskin.snn.data.gains import GAINS, binned
from eskin.snn.data.scans import ScanData, filled
from eskin.snn.experiments.inner import FEW, judged, pooled, repeats
from eskin.snn.experiments.recipes import RECIPES, batch_for, epochs_for, for_recordings

MAX_JUDGED = 350
"""Training recordings on which settings are compared at most, evenly spread over the classes."""

PARTS = 5
"""Parts of the training recordings; one part, another in every round, is the inner validation, or ``REPEATS`` parts in
turn (``repeats``)."""

BASELINES: tuple[Baseline, ...] = ("fixed", "median")
"""Baselines that are compared with the default, the first value."""

FIRST_ENCODING, BITS = "nlcs-bipolar", (4, 6)
"""Encoder with which baselines and scales are compared, and the resolutions that are compared."""

UPDATES, HIDDEN = (120, 120, 240, 480), 64
"""Updates of the short trainings in each round, and neurons of their networks."""

LONG = 1920
"""Updates of the trainings that compare gains where there are few recordings; fewer do not show the difference."""

SIZE = {"rows", "columns", "sample_bits", "sample_rate_hz", "clocks_per_sample"}
FREE = {"resolution", "scale", "baseline", "gains", "link", "frontend", "reset", "receptive_fields", *SIZE}
"""Fields that a user can set during the choice of an encoder; the other fields follow from the encoder."""


class Judged(NamedTuple):
    """Score of a preparation and a readout; the best is the least."""

    wrong: int
    log_loss: float
    number: int
    bits_per_s: float
    options: Preparation
    config: ReadoutConfig
    of: int


@dataclass(frozen=True)
class EncoderChoice(Fit):
    """Choice of encoder, resolution, baseline and full scale from the training recordings of one fold.

    All taxels have a common scale, or each has its own.
    """

    fold: int = 0
    """Test fold."""
    folds: int = 6
    test: str | None = None
    """Pattern of the names of the test recordings, instead of a fold."""

    def learned(self, names: Sequence[str], classes: Sequence[str], groups: Sequence[str]) -> NDArray[np.int64]:
        """Return the numbers of the training recordings."""
        if self.test is not None:
            tested = matching(names, self.test)
        else:
            kinds, labels = np.unique(classes, return_inverse=True)
            folds = possible_folds(labels, self.folds, groups)
            if self.fold >= folds:
                raise InputError(f"fold must be in 0..{folds - 1}, not {self.fold}")
            tested = stratified_folds(labels, folds, class_names=kinds.tolist(), groups=groups)[self.fold]
            check_classes(labels, tested, kinds.tolist())
        return np.setdiff1d(np.arange(len(names)), tested)

    def variants(self, options: Preparation, given: Collection[str], number: int) -> tuple[Preparation, ...]:
        """Return the preparations to compare: every baseline, and a common scale or one for each taxel.

        With groups, or few recordings, each preparation is compared without and with ``GAINS``.
        """
        baselines = [options.baseline, *BASELINES] if "baseline" not in given else [options.baseline]
        scales = [options.scale]
        if options.scale == "max" and "scale" not in given and not {"encoding", "resolution"} <= set(given):
            scales.append(PER_TAXEL)
        few = bool(options.group_name or options.group_column) or number <= FEW
        found = [
            dataclasses.replace(options, baseline=one, scale=scale, gains=gains)
            for gains in ([(), GAINS] if few and "gains" not in given else [options.gains])
            for scale in scales
            for one in baselines
        ]
        return tuple(dict.fromkeys(found))

    def choose(
        self,
        config: ReadoutConfig,
        given: Collection[str],
        classes: Sequence[str],
        groups: Sequence[str],
        recordings: Mapping[Preparation, Sequence[NDArray[np.int32]]],
        levels: Mapping[Preparation, NDArray[np.float64]],
        progress: Callable[[], object],
    ) -> tuple[ReadoutConfig, Preparation, str, list[dict[str, Any]]]:
        """Return the configuration and preparation with which short trainings classify best, with all scores.

        The first round compares baselines, scales and gains, the others encoders and resolutions. After a round, the
        better half remains; of the last, the one with the fewest bit/s wins that is at most one standard error below
        the best. With fewer than two recordings of a class, ``Fit`` chooses.

        With groups or few recordings, the log loss decides, and the best preparations of two baselines remain after the
        first round. Few recordings without groups compare gains at the end, by longer trainings.
        """
        some = slice(None, None, -(-len(classes) // MAX_JUDGED))
        labels = np.unique(classes[some], return_inverse=True)[1].astype(np.int64)
        if np.bincount(labels).min() < 2 or len(set(labels.tolist())) < 2:
            judged_of = {options: codes[some] for options, codes in recordings.items()}
            return super().choose(config, given, classes, groups, judged_of, levels, progress)
        signals = next(iter(recordings.values()))[some]
        bin_s = min(BinConfig().bin_s, 2 * bin_of_spectrum(signals, config.sample_rate_hz))
        parts, scores = _parts(labels, list(groups)[some]), list[dict[str, Any]]()
        grouped = len(set(groups)) < len(groups)
        turns = min(repeats(len(labels), grouped), len(parts))

        def ranked(
            candidates: Sequence[tuple[Preparation, ReadoutConfig]], number: int, updates: int = 0
        ) -> list[Judged]:
            """Return the scores of a round, the best first; ``updates`` are of trainings with half windows."""
            found, halves = list[Judged](), updates > 0
            judges = [parts[(number + turn) % len(parts)] for turn in range(turns)]
            updates = updates or UPDATES[number]
            for place, (options, tried) in enumerate(candidates):
                scans, bps = _scans(tried, recordings[options][some], labels, bin_s, options.gains, levels[options])
                right, loss, of = pooled([_short_training(scans, part, updates, halves) for part in judges], judges)
                found.append(Judged(of - right, loss, place, bps, options, tried, of))
                scores.append(_said(found[-1], updates))
                progress()
            return sorted(found, key=lambda one: one.log_loss) if turns > 1 else sorted(found)

        tried_first = [one for one in recordings if grouped or one.gains == next(iter(recordings)).gains]
        kept = tried_first[:1]
        if len(tried_first) > 1:
            encoding = FIRST_ENCODING if set(given) <= FREE else config.encoding
            first = with_seconds(config.replace(encoding=encoding, clocks_per_sample=MAX_CLOCKS), given, self.tau_s)
            first = first if "resolution" in given else first.replace(resolution=BITS[0])
            best = [one.options for one in ranked([(one, first) for one in tried_first], 0)]
            of_baselines = {one.baseline: one for one in reversed(best)}
            kept = [one for one in best if one == of_baselines[one.baseline]][: 2 if turns > 1 else 1]
        left = [(one, tried) for one in kept for tried in _candidates(config, given, self.tau_s)]
        if "encoding" not in given:
            left = [one for one in left if not negative_part_lost(one[1], recordings[one[0]])]
        for number in range(1, len(UPDATES) - 1):
            if len(left) > 2:
                left = [(one.options, one.config) for one in ranked(left, number)][: -(-len(left) // 2)]
        last = ranked(left, len(UPDATES) - 1)
        error = math.sqrt(last[0].wrong * (1 - last[0].wrong / last[0].of))
        found = min((one for one in last if one.wrong <= last[0].wrong + error), key=lambda one: one.bits_per_s)
        alike = [one for one in recordings if dataclasses.replace(one, gains=found.options.gains) == found.options]
        if not grouped and len(alike) > 1:
            found = ranked([(one, found.config) for one in alike], len(UPDATES), LONG)[0]
        note = _note(found, len(scores))
        return found.config.replace(clocks_per_sample=config.clocks_per_sample), found.options, note, scores


def _said(one: Judged, updates: int) -> dict[str, Any]:
    """Return a score as plain values."""
    said: dict[str, Any] = {
        "encoding": one.config.encoding,
        "resolution": one.config.resolution,
        "baseline": one.options.baseline,
    }
    said |= {"scale": one.options.scale, "bits_per_s": one.bits_per_s, "updates": updates}
    said |= {"gains": list(one.options.gains)} if one.options.gains else {}
    return said | {"right": one.of - one.wrong, "of": one.of, "log_loss": one.log_loss}


def _note(found: Judged, trainings: int) -> str:
    """Return the sentence on the chosen settings."""
    options = found.options
    scale = "a scale per taxel" if options.scale == PER_TAXEL else "a common scale"
    gains = f"gains {', '.join(map('{:g}'.format, options.gains))}, " if options.gains else ""
    return (
        f"encoder {found.config.encoding} with {found.config.resolution} b, baseline {options.baseline}, {scale}, "
        f"{gains}{found.bits_per_s:.3g} bit/s: the last of {trainings} short trainings found the class of "
        f"{found.of - found.wrong} of {found.of} other recordings; "
        f"--encoding, --resolution, --baseline and --scale choose others"
    )


def _parts(labels: NDArray[np.int64], groups: Sequence[str]) -> list[NDArray[np.int64]]:
    """Return the inner validation parts; a group is in one part, unless a class has one group."""
    pairs = set(zip(labels.tolist(), groups, strict=True))
    if len(set(groups)) < len(groups) and min(Counter(label for label, _ in pairs).values()) > 1:
        return stratified_folds(labels, min(PARTS, len(set(groups))), groups=groups)
    return stratified_folds(labels, min(PARTS, int(np.bincount(labels).min())))


def _candidates(config: ReadoutConfig, given: Collection[str], tau_s: float | None) -> Iterable[ReadoutConfig]:
    """Yield every encoder and resolution that the given fields permit."""
    encodings = registry.NAMES if set(given) <= FREE else [config.encoding]
    resolutions = [config.resolution] if "resolution" in given else BITS
    for tried in cases(config.replace(clocks_per_sample=MAX_CLOCKS), encoding=encodings, resolution=resolutions):
        yield with_seconds(tried, given, tau_s)


def _scans(
    config: ReadoutConfig,
    recordings: Sequence[NDArray[np.int32]],
    labels: NDArray[np.int64],
    bin_s: float,
    gains: Sequence[float] = (),
    levels: NDArray[np.float64] | None = None,
) -> tuple[ScanData, float]:
    """Return the event counts of recordings in time bins, then those at other gains, and the bit/s of the former."""
    ticks = max(round(bin_s * config.sample_rate_hz), 1)
    bins, bits = BinConfig(bin_s=ticks / config.sample_rate_hz), config.sample_bits
    levels = np.zeros(config.taxels) if levels is None else levels
    scans = [binned(config, codes, bins) for codes in recordings]
    events = sum(int(scan.sum()) for scan in scans)
    scans += [binned(config, at_gain(codes, gain, levels, bits), bins) for gain in gains for codes in recordings]
    numbers = np.arange(len(recordings))
    events_hz = events * config.sample_rate_hz / sum(map(len, recordings))
    data = ScanData(
        values=filled(scans),
        labels=np.tile(labels, 1 + len(gains)),
        images=np.tile(numbers, 1 + len(gains)),
        names=tuple(map(str, numbers)),
        class_names=tuple(map(str, range(int(labels.max()) + 1))),
        taxels=config.taxels,
        step_s=ticks / config.sample_rate_hz,
        rate_hz=events_hz,
        lengths=np.array([len(scan) for scan in scans], np.int64),
    )
    return data, events_hz * config.event_bits


def _short_training(data: ScanData, part: NDArray[np.int64], updates: int, halves: bool = False) -> tuple[int, float]:
    """Return the number of correct recordings of a part, and their log loss, after a training on the others.

    With ``halves``, the network learns its decays on windows of half a recording.
    """
    from eskin.snn.network_config import NetworkConfig
    from eskin.snn.training import TrainConfig, parted

    learned = np.setdiff1d(np.arange(len(data.names)), part)
    seconds = np.array([data.steps_of(scan) * data.step_s for scan in range(len(data.names))])
    follows = for_recordings("skin", seconds, data.step_s)
    if halves:
        half = max(int(seconds.min() / data.step_s) // 2, 1)
        follows |= {"learn_decay": True, "window_steps": half, "windows": 2}
        follows["batch"] = batch_for(2 * len(data))
    network, training = parted(RECIPES["skin"] | follows | {"hidden": HIDDEN})
    made = TrainConfig.from_dict(training)
    made = dataclasses.replace(made, epochs=epochs_for(len(data.scans_of(learned)), made.windows, made.batch, updates))
    shape = {"inputs": data.channels, "classes": len(data.class_names)}
    return judged(data, learned, part, NetworkConfig.from_dict(network | shape), made, 0)
