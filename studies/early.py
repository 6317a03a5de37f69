"""Early: accuracy and time of early decisions by the margin, in integers, on recordings of a real finger.

The network is that of ``eskin train --data fabricslide --test '*_1'`` with N-LCS 4 b and the fixed baseline.
"""

from pathlib import Path

from eskin.base.errors import InputError
from eskin.snn.exchange.integer import Precision, quantise
from eskin.snn.exchange.weights import load_weights
from eskin.snn.experiments.evaluate import early_decisions
from eskin.snn.experiments.trained import result_beside
from studies.study import Data, Result, run

WEIGHTS = Path("out/train-finger/weights.npz")

MARGINS = tuple(2**power for power in range(15, 20))


def compute() -> Data:
    """Return the results on the test recordings at every margin, and without early decisions."""
    if not WEIGHTS.exists():
        raise InputError(f"{WEIGHTS} does not exist; train the network as docs/results/classifier.md shows")
    weights = load_weights(WEIGHTS)
    result = result_beside(WEIGHTS, weights)
    if result is None:
        raise InputError(f"result.json of the training is missing beside {WEIGHTS}")
    data = result.experiment.data()
    network = quantise(weights, Precision(narrow=True)).network
    never = 2 ** (network.config.evidence_bits + 1)
    rows = early_decisions(network, data, result.test_images(data.image_labels), [*MARGINS, never])
    return {"margins": rows[:-1], "whole": rows[-1] | {"margin": 0}}


RESULT = Result("classifier/early", compute)

if __name__ == "__main__":
    run("early", RESULT)
