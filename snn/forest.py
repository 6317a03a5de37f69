"""Extremely randomised trees (Geurts, Ernst, Wehenkel, Machine Learning 63:3, 2006), a plain reference classifier."""

import math

import numpy as np
from numpy.typing import NDArray

TREES = 100


def forest_classes(
    columns: NDArray[np.float64], labels: NDArray[np.int64], learned: NDArray[np.int64], test: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return the class of each test row, the class with most votes of ``TREES`` trees of the learned rows.

    A node compares one column with a threshold: of a few random columns, each with a random threshold, the one that
    separates the classes best (Gini). Leaves are pure, and test rows go down each tree while it grows.
    """
    random, kinds = np.random.default_rng(0), np.eye(int(labels.max()) + 1)[labels]
    tried = max(round(math.sqrt(columns.shape[1])), 1)
    votes = np.zeros(kinds.shape)
    for _ in range(TREES):
        nodes = [(learned, test)]
        while nodes:
            rows, tested = nodes.pop()
            if len(tested) == 0:
                continue
            counts = kinds[rows].sum(0)
            some = random.permutation(columns.shape[1])[:tried]
            values = columns[np.ix_(rows, some)]
            low, high = values.min(0), values.max(0)
            if counts.max() == len(rows) or (low == high).all():
                votes[tested] += counts / len(rows)
                continue
            threshold = random.uniform(low, high)
            below = values <= threshold
            left = below.T.astype(np.float64) @ kinds[rows]
            right = counts - left
            purity = sum((side**2).sum(1) / np.maximum(side.sum(1), 1) for side in (left, right))
            best = int(np.argmax(np.where(low < high, purity, -1.0)))
            goes = columns[tested, some[best]] <= threshold[best]
            nodes += [(rows[below[:, best]], tested[goes]), (rows[~below[:, best]], tested[~goes])]
    return np.asarray(votes[test].argmax(1))
