"""Compare the CPU time of whole training epochs with the time in the compiled kernel and in the hidden layer.

``python benchmarks/training.py --json benchmarks/results/training.json``

The training is that of ``make train``: recipe "tuned", LCS 4 b, embedded textures, one thread. Ratios are taken within
an epoch. The first epoch is not counted, and loading torch and recording the scans happen before. "Kernel" is the time
in functions of the compiled library; "layer" also has the torch code that calls these functions.
"""

import itertools
import platform
import time
from typing import Annotated, Any

import torch
import typer
from measure import JsonFile, spread, write

from eskin.snn.data.scans import Split
from eskin.snn.experiments.experiment import Experiment
from eskin.snn.experiments.recipes import RECIPES
from eskin.snn.experiments.single import Fold
from eskin.snn.kernels import cpu
from eskin.snn.kernels.layer import SparseLayer
from eskin.snn.train import train
from eskin.snn.training import TrainConfig, parted

NAMES = {"kernel": "compiled functions alone", "layer": "hidden layer, forward and backward"}

SPENT = {"kernel": 0.0, "layer": 0.0}
"""CPU time of each part in seconds, added up during the run."""


def count(owner: Any, name: str, part: str) -> None:
    """Wrap a function so that its CPU time is added to a part of ``SPENT``."""
    inner = getattr(owner, name)

    def counted(*arguments: Any) -> Any:
        start = time.thread_time()
        found = inner(*arguments)
        SPENT[part] += time.thread_time() - start
        return found

    setattr(owner, name, staticmethod(counted) if isinstance(owner, type) else counted)


def ratios(marks: list[dict[str, float]], part: str) -> dict[str, float]:
    """Divide the time of an epoch by the time of a part; return median, least and most, without the first epoch."""
    return spread(
        [
            (after["whole"] - before["whole"]) / (after[part] - before[part])
            for before, after in itertools.pairwise(marks)
        ]
    )


def main(
    json_file: JsonFile = None,
    epochs: Annotated[int, typer.Option(min=3, help="epochs of the training")] = 20,
) -> None:
    """Time the epochs of a training on one core."""
    torch.set_num_threads(1)
    network, training = parted(RECIPES["tuned"] | {"epochs": epochs})
    experiment = Experiment(network=network, train=TrainConfig.from_dict(training))
    data = experiment.data()
    count(cpu, "_call", "kernel")
    count(SparseLayer, "forward", "layer")
    count(SparseLayer, "backward", "layer")
    marks: list[dict[str, float]] = []
    train(
        Split(data, Fold.choose(data, 0, 6).images, None),
        experiment.network_config(data),
        experiment.train,
        0,
        progress=lambda _: marks.append({"whole": time.thread_time(), **SPENT}),
    )
    results = [{"name": NAMES[part], "times": ratios(marks, part)} for part in SPENT]
    for result in results:
        print(result["name"], "{median:.2f} ({least:.2f} to {most:.2f})".format(**result["times"]))
    machine = {"torch": torch.__version__, "instruction_set": platform.machine()}
    machine["cpu_capability"] = torch.backends.cpu.get_cpu_capability()
    write(json_file, "training", f"--epochs {epochs}", {"epochs": epochs, **machine, "results": results})


if __name__ == "__main__":
    typer.run(main)
