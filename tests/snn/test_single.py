"""Test the choice of test and training images of a fold."""

from __future__ import annotations

import numpy as np

from eskin.snn.experiments.single import Fold
from tests.snn.helpers import easy_data


def test_every_image_is_tested_once_and_never_learned_where_it_is_tested() -> None:
    data = easy_data()
    folds = [Fold.choose(data, number, 3) for number in range(3)]
    assert sorted(np.concatenate([fold.test for fold in folds])) == list(range(len(data.image_labels)))
    for number, fold in enumerate(folds):
        assert (fold.number, fold.of) == (number, 3)
        assert sorted([*fold.test, *fold.images]) == list(range(len(data.image_labels)))
        assert set(data.image_labels[fold.test]) == set(data.image_labels)
