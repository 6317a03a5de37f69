"""How well the integer network classifies, beside the float network that it was made from."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from model.classifier.file import IntegerWeights
from model.classifier.network import IntegerNetwork
from model.errors import InputError
from snn.data.scans import ScanData
from snn.exchange.weights import load_weights
from snn.experiments.trained import read_result
from snn.train import predicted_classes


def integer_classes(
    network: IntegerNetwork, data: ScanData, images: Sequence[int] | NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return the class of every image by the integer network, from the scan of its first start row."""
    scans = data.scans_of(images, first_row_only=True)
    of_image = dict(zip(data.images[scans].tolist(), scans.tolist(), strict=True))
    evidence, _ = network.run_counts(data.values[[of_image[int(image)] for image in images]])
    return evidence.argmax(1)


def compare(weights_file: Path, made: IntegerWeights) -> str:
    """Return the accuracy of both networks on the test images of the training, as a sentence.

    Raises
    ------
    InputError
        If there is no result of the training beside the weights, or it took frames.
    """
    note = weights_file.parent / "result.json"
    if not note.exists():
        raise InputError(f"--accuracy needs the result.json of the training beside {weights_file.name}")
    weights = load_weights(weights_file)
    result = read_result(note, weights_file, weights)
    data = result.experiment.data()
    images = result.test_images(data.image_labels)
    labels = data.image_labels[images]
    right = int((predicted_classes(weights.network, data, images) == labels).sum())
    whole = int((integer_classes(made.network, data, images) == labels).sum())
    return f"test images of the fold: float {right} of {len(labels)} right, integer {whole} of {len(labels)}"
