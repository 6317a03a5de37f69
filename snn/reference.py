"""Plain references for recordings: logistic regression and a forest on statistics, and the most frequent class."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.skin.recordings.event_files import statistics
from eskin.snn.data.scans import ScanData
from eskin.snn.forest import forest_classes

PENALTY = 1.0
"""Half of this number times the sum of all squared weights is added to the loss (scikit-learn: C = 1)."""

LEAST_RATE = 1e-3
"""Events per step that are added before a logarithm."""


def event_statistics(data: ScanData) -> NDArray[np.float64]:
    """Return ``event_columns`` of every image, from its first scan, shape (images, columns)."""
    scans = data.first_scans(range(len(data.names)))
    counts = [data.values[scan, : data.steps_of(scan)].astype(np.float64) for scan in scans]
    return np.array([event_columns(one, data.taxels) for one in counts])


def event_columns(counts: NDArray[np.float64], taxels: int) -> NDArray[np.float64]:
    """Return statistics of the events or frames of a scan of shape (steps, channels).

    These are the logarithm of the mean magnitude of each channel (of events, their rate), and ``statistics`` of ON less
    OFF events of each taxel, or of the frames.
    """
    signed = counts.shape[1] == 2 * taxels and counts.min(initial=0) >= 0
    net = counts[:, :taxels] - counts[:, taxels:] if signed else counts
    return np.concatenate([np.log(np.abs(counts).mean(0) + LEAST_RATE), statistics(net)])


def logistic_classes(
    columns: NDArray[np.float64], labels: NDArray[np.int64], learned: NDArray[np.int64], test: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return the class of each test row, predicted by a multinomial logistic regression.

    Columns have mean 0 and deviation 1 over the learned rows.
    """
    from scipy.optimize import minimize

    mean, deviation = columns[learned].mean(0), columns[learned].std(0)
    rows = (columns - mean) / np.where(deviation > 0, deviation, 1.0)
    rows = np.hstack([rows, np.ones((len(rows), 1))])
    x, classes = rows[learned], int(labels.max()) + 1
    wanted = np.eye(classes)[labels[learned]]

    def loss(flat: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        weights = flat.reshape(-1, classes)
        logits = x @ weights
        logits -= logits.max(1, keepdims=True)
        logs = logits - np.log(np.exp(logits).sum(1, keepdims=True))
        kept = np.vstack([weights[:-1], np.zeros((1, classes))])  # the bias costs nothing
        gradient = x.T @ (np.exp(logs) - wanted) + PENALTY * kept
        return float(-(wanted * logs).sum() + PENALTY / 2 * (kept**2).sum()), gradient.ravel()

    start = np.zeros(x.shape[1] * classes)
    weights = minimize(loss, start, jac=True, method="L-BFGS-B", options={"maxiter": 200}).x.reshape(-1, classes)
    return np.asarray((rows[test] @ weights).argmax(1))


def score(labels: NDArray[np.int64], predicted: NDArray[np.int64]) -> dict[str, Any]:
    """Return accuracy, balanced accuracy (the mean over classes), and the number of correct predictions."""
    right = labels == predicted
    of_classes = [right[labels == label].mean() for label in np.unique(labels)]
    return {
        "accuracy": float(right.mean()),
        "balanced_accuracy": float(np.mean(of_classes)),
        "right": int(right.sum()),
    }


def references(
    data: ScanData, learned: NDArray[np.int64], test: NDArray[np.int64], signals: NDArray[np.float64] | None = None
) -> dict[str, dict[str, Any]]:
    """Return the ``score`` of each baseline classifier on the test images.

    - ``learned``, ``test``: images.
    - ``signals``: shape (images, columns); statistics of the signals behind the events.
    """
    labels = data.image_labels
    most = int(np.bincount(labels[learned]).argmax())
    found = {"events": logistic_classes(event_statistics(data), labels, learned, test)}
    if signals is not None:
        found["signals"] = logistic_classes(signals, labels, learned, test)
        found["forest"] = forest_classes(signals, labels, learned, test)
    found["most frequent class"] = np.full(len(test), most)
    return {name: score(labels[test], one) | {"predicted": one.tolist()} for name, one in found.items()}


def is_unbalanced(labels: NDArray[np.int64]) -> bool:
    """Return True if the largest class has over one and a half times the recordings of the smallest."""
    counts = np.bincount(labels)
    counts = counts[counts > 0]
    return bool(counts.max() > 1.5 * counts.min())
