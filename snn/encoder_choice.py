"""Choose encoder, resolution and scale by the accuracy of a logistic regression on the events."""

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.model.cases import cases
from eskin.model.config import ReadoutConfig
from eskin.model.encoders import registry
from eskin.model.taxel import encode_timed
from eskin.skin.recordings.fitting import RESOLUTIONS, Fit, with_seconds
from eskin.skin.recordings.folder import negative_part_lost
from eskin.skin.recordings.options import PER_TAXEL
from eskin.skin.recordings.quality import MAX_CLOCKS
from eskin.snn.data.bins import BinConfig
from eskin.snn.data.folds import check_classes, matching, possible_folds, stratified_folds
from eskin.snn.reference import event_columns, logistic_classes

MAX_JUDGED = 150
"""Training recordings on which encoders are compared at most, evenly spread over the classes."""

INNER_FOLDS = 3

SIZE = {"rows", "columns", "sample_bits", "sample_rate_hz", "clocks_per_sample"}
FREE = {"resolution", "scale", "link", "frontend", "reset", "receptive_fields", *SIZE}
"""Fields that a user can set during the choice of an encoder; the other fields follow from the encoder."""


@dataclass(frozen=True)
class EncoderChoice(Fit):
    """Choice of encoder, resolution and full scale from the training recordings of one fold.

    All taxels have a common scale, or each has its own.
    """

    other_scales: ClassVar[tuple[str, ...]] = (PER_TAXEL,)

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

    def choose(
        self,
        config: ReadoutConfig,
        given: Collection[str],
        classes: Sequence[str],
        recordings: Mapping[str, Sequence[NDArray[np.int32]]],
        progress: Callable[[], object],
    ) -> tuple[ReadoutConfig, str, str]:
        """Return the configuration and scale with the lowest data rate among the most accurate candidates.

        That is at most one standard error below the best accuracy, by inner cross-validation of a logistic regression
        on event statistics. With fewer than two recordings of a class, ``Fit`` chooses.
        """
        some = slice(None, None, -(-len(classes) // MAX_JUDGED))
        labels = np.unique(classes[some], return_inverse=True)[1]
        inner = min(INNER_FOLDS, int(np.bincount(labels).min()))
        if inner < 2 or len(set(labels.tolist())) < 2:
            judged_of = {scale: codes[some] for scale, codes in recordings.items()}
            return super().choose(config, given, classes, judged_of, progress)
        found = []
        for scale, codes in recordings.items():
            judged = codes[some]
            seconds = sum(map(len, judged)) / config.sample_rate_hz
            for tried in _candidates(config, given, self.tau_s):
                if "encoding" not in given and negative_part_lost(tried, judged):
                    continue
                columns, events = _statistics(tried, judged)
                accuracy = _accuracy(columns, labels, inner)
                found.append((accuracy, events * tried.event_bits / seconds, tried, scale))
                progress()
        best = max(accuracy for accuracy, *_ in found)
        error = math.sqrt(best * (1 - best) / len(labels))
        accuracy, bps, chosen, scale = min((one for one in found if one[0] >= best - error), key=lambda one: one[1])
        of_taxels, others = "", "--encoding and --resolution"
        if len(recordings) > 1:
            of_taxels = " and a scale per taxel" if scale == PER_TAXEL else " and a common scale"
            others = "--encoding, --resolution and --scale"
        return (
            chosen.replace(clocks_per_sample=config.clocks_per_sample),
            scale,
            f"encoder {chosen.encoding} with {chosen.resolution} b{of_taxels}, {bps:.3g} bit/s: inner validation with "
            f"a logistic regression on event statistics finds the class of {accuracy:.0%} of {len(labels)} training "
            f"recordings, and of {best:.0%} with the best of {len(found)} settings; {others} choose others",
        )


def _candidates(config: ReadoutConfig, given: Collection[str], tau_s: float | None) -> Iterable[ReadoutConfig]:
    """Yield every encoder and resolution that the given fields permit."""
    encodings = registry.NAMES if set(given) <= FREE else [config.encoding]
    resolutions = [config.resolution] if "resolution" in given else RESOLUTIONS
    for tried in cases(config.replace(clocks_per_sample=MAX_CLOCKS), encoding=encodings, resolution=resolutions):
        yield with_seconds(tried, given, tau_s)


def _statistics(config: ReadoutConfig, recordings: Iterable[NDArray[np.int32]]) -> tuple[NDArray[np.float64], int]:
    """Return the event statistics of each recording, and the number of all events."""
    ticks = max(round(BinConfig().bin_s * config.sample_rate_hz), 1)
    columns, events = [], 0
    for codes in recordings:
        counts, _ = encode_timed(config, codes)
        channels = np.hstack([np.maximum(counts, 0), np.maximum(-counts, 0)]) if config.has_polarity else counts
        bins = np.add.reduceat(channels, np.arange(0, len(counts), ticks), axis=0, dtype=np.float64)
        columns.append(event_columns(bins, config.taxels))
        events += int(np.abs(counts).sum())
    return np.array(columns), events


def _accuracy(columns: NDArray[np.float64], labels: NDArray[np.int64], inner: int) -> float:
    """Return the part of the recordings that a logistic regression classifies correctly in inner folds."""
    every = np.arange(len(labels))
    right = 0
    for part in stratified_folds(labels, inner):
        right += int((logistic_classes(columns, labels, np.setdiff1d(every, part), part) == labels[part]).sum())
    return right / len(labels)
