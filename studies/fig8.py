"""Fig. 8: one scan from texture through events and hidden spikes to the evidence of each class.

The network is that of ``eskin train`` in ``out/train``.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from eskin.base.errors import InputError
from eskin.model.events.recording import Recording
from eskin.skin.figures.scan_to_class import ScanToClass, plot_scan
from eskin.skin.textures.dataset import open_dataset
from eskin.skin.textures.scan import Scan
from eskin.snn.data.bins import counted_from
from eskin.snn.data.record import record
from eskin.snn.data.scans import collect
from eskin.snn.exchange.weights import Weights, load_weights
from eskin.snn.experiments.trained import TrainingResult, read_result
from eskin.snn.kernels.layer import layer
from eskin.snn.network import SpikingNetwork, synaptic
from studies.study import Result, run

WEIGHTS = Path("out/train/weights.npz")
RECORDINGS: Path | None = None
"""Your own recordings, if the network was trained on them."""
IMAGE: str | None = None
"""Name of the texture or recording, such as brick/brick-00; None for the first test image that is classified right."""

MEANINGS = {"spikes": "output spikes so far", "membrane": "output membranes so far, divided by all steps"}
"""Meaning of the evidence, by the readout of the network."""

Source = tuple[Recording, NDArray[np.int32], Scan | None, NDArray[np.uint8] | None]
"""Events and codes of an image; with a texture, its scan and pixels."""

Images = tuple[list[str], NDArray[np.int64], Callable[[int], Source]]
"""Names and labels of images, and the function that returns an image by its number."""


@torch.no_grad()
def evidence(network: SpikingNetwork, x: Tensor) -> tuple[Tensor, Tensor]:
    """Return the hidden spikes, and the evidence of each class after each step.

    - ``x``: shape (steps, scans, inputs).

    The spikes have the shape (steps, scans, hidden), the evidence (steps, scans, classes): output spikes so far; or the
    sum of the output membranes so far, divided by the number of all steps.
    """
    config = network.config
    spikes = network.spikes(x)
    _, decay = network.decays()
    if config.readout == "spikes":
        currents = config.output_synapse_decay
        parts = layer(config.rule, spikes, network.w_out, network.b_out, decay, None, network.backend, currents)
    else:
        parts = functional.linear(spikes, network.w_out, network.b_out)
        parts = synaptic(parts, config.output_synapse_decay).clone()
        for step in range(1, len(parts)):
            parts[step] += decay * parts[step - 1]
        parts /= len(parts)
    return spikes, parts.cumsum(0) * config.output_scale


def play(
    weights_file: Path,
    result_file: Path,
    folder: Path | None = None,
    image: str | None = None,
) -> ScanToClass:
    """Return the response of a network to a scan of its dataset or to a user's recording.

    - ``weights_file``, ``result_file``: what ``eskin train`` wrote: the network, and the experiment that says how scans
      are made.
    - ``folder``: own recordings; by default the textures of the training.
    - ``image``: name of the texture or recording. By default the first image of the test fold that the result lists as
      correctly classified, else the first one.

    Raise InputError if the two files do not belong together, or are not of a spiking network on textures or own
    recordings.
    """
    weights = load_weights(weights_file)
    if not result_file.is_file():
        raise InputError(
            f"{result_file} does not exist, but fig8 needs the result of the training; train again with eskin train"
        )
    if not isinstance(weights.network, SpikingNetwork):
        raise InputError(f"{weights_file} holds a baseline for frames; fig8 needs a spiking network")
    result = read_result(result_file, weights_file, weights)
    if folder is not None:
        names, labels, source = _own(weights, result, folder)
    elif result.experiment.events is None and result.experiment.frames is None:
        names, labels, source = _textures(weights, result)
    else:
        more = "; write the folder of your recordings into RECORDINGS of studies/fig8.py" if result.own else ""
        raise InputError(
            f"{result_file} is of a training on event files or frames; fig8 needs a training on textures{more}"
        )
    test = result.test_images(labels)
    if image is not None and image not in names:
        raise InputError(f"there is no image {image!r}; there are {len(names)} images, from {names[0]} to {names[-1]}")
    index = result.default_image(test) if image is None else names.index(image)
    recording, codes, scan, pixels = source(index)
    network, config, bins = weights.network, recording.config, result.experiment.bins
    spikes, grown = evidence(network, collect([recording], bins, weights.class_names).batch([0]))
    scale = network.config.output_scale
    return ScanToClass(
        name=names[index],
        true=weights.class_names[labels[index]],
        label=int(labels[index]),
        tested=index in test,
        scan=scan,
        pixels=pixels,
        recording=recording,
        signals=codes / config.full_scale,
        start_s=counted_from(recording, bins.start_s) / config.clock_hz,
        step_s=bins.bin_s,
        spikes=spikes[:, 0].numpy(),
        evidence=grown[:, 0].numpy(),
        class_names=weights.class_names,
        meaning=MEANINGS[network.config.readout] + (f", times {scale:g}" if scale != 1 else ""),
        right=sum(result.right),
        tests=len(result.right),
    )


def _textures(weights: Weights, result: TrainingResult) -> Images:
    """Return the textures of the training, scanned as in the training."""
    scan, config = result.experiment.scan_and_config()
    textures = open_dataset(result.experiment.dataset)
    if textures.class_names != weights.class_names:
        raise InputError(
            f"the network knows the classes {', '.join(weights.class_names)}, the textures are "
            f"{', '.join(textures.class_names)}; give the textures of the training with --dataset"
        )

    def source(index: int) -> Source:
        texture = textures[index]
        pixels = texture.load()
        return record(texture, textures.name, scan, config), scan.samples(config, pixels)[0], scan, pixels

    return [texture.name for texture in textures], textures.labels, source


def _own(weights: Weights, result: TrainingResult, place: Path) -> Images:
    """Return a user's recordings, prepared as in the training."""
    if result.own is None:
        raise InputError("the network was not trained on your own recordings; train with eskin train --data")
    found, classes = result.own.read(place), weights.class_names
    if strange := [source for source in found.sources if source.class_name not in classes]:
        raise InputError(f"{strange[0].path} is not in a class of the network: {', '.join(classes)}")
    labels = np.array([classes.index(str(source.class_name)) for source in found.sources])
    names = [source.name for source in found.sources]
    return names, labels, lambda index: (found.recording(index)[0], found.codes[index], None, None)


def result() -> Result:
    """Return the result of the study for the network in ``WEIGHTS``."""
    played: list[ScanToClass] = []

    def compute() -> dict[str, Any]:
        played.append(play(WEIGHTS, WEIGHTS.parent / "result.json", folder=RECORDINGS, image=IMAGE))
        return played[0].to_dict()

    return Result("fig8", compute, lambda _, path: plot_scan(played[0], path))


if __name__ == "__main__":
    run("fig8", result())
