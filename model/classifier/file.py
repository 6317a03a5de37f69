"""Read and write files of integer networks, and images of their weight memories."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base import formats
from eskin.base.errors import InputError
from eskin.base.files import atomic_write, read_arrays, write_arrays
from eskin.base.outputs import check_file
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.classifier.network import IntegerNetwork
from eskin.model.classifier.words import packed, unpacked

ARRAYS = {"w_in": np.int8, "w_rec": np.int8, "w_out": np.int8, "b_hidden": np.int16, "b_out": np.int16}
PARAMETERS = {"threshold": np.int32, "leak": np.int8, "out_threshold": np.int32, "out_leak": np.int8}
"""Arrays of a file, and those that only a network with own parameters has."""


@dataclass(frozen=True)
class IntegerWeights:
    """An integer network with the names of its classes, in the order of the outputs, and notes.

    ``notes`` are those of the quantiser: the float value of a weight of 1 for each matrix, the errors, and under
    ``training`` the readout and bins of the training, and its predictions for images outside the training.
    """

    network: IntegerNetwork
    class_names: tuple[str, ...]
    notes: dict[str, Any] = field(default_factory=dict)

    def save(self, path: str | Path) -> None:
        """Write the network to an ``.npz`` file."""
        path = Path(path)
        if path.suffix != ".npz":
            raise InputError(f"integer networks end in .npz, {path.name} does not; rename the output")
        header = {
            "format": formats.INTEGER.name,
            "format_version": formats.INTEGER.version,
            "classifier": self.network.config.to_dict(),
            "class_names": list(self.class_names),
            "notes": self.notes,
        }
        kinds = arrays_of(self.network.config)
        arrays: dict[str, NDArray[Any]] = {n: getattr(self.network, n).astype(kind) for n, kind in kinds.items()}
        arrays["metadata"] = np.array(json.dumps(header))
        write_arrays(path, arrays, compressed=True)

    @classmethod
    def load(cls, path: Path) -> IntegerWeights:
        """Return the network from a file written by ``save``; raise InputError for any other file."""
        if not path.exists():
            raise InputError(f"integer network {path} does not exist; make one with eskin quantise")
        return cls.of(path, read_arrays(path, "an integer network", "quantise again"))

    @classmethod
    def of(cls, path: Path, arrays: dict[str, NDArray[Any]]) -> IntegerWeights:
        """Return the network for the arrays of a file; raise InputError if they are something else."""
        try:
            return cls._from_arrays(arrays)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
        except (KeyError, TypeError, ValueError, RecursionError):
            raise InputError(
                f"{path} is an archive, but not an integer network; make one with eskin quantise"
            ) from None

    @classmethod
    def _from_arrays(cls, arrays: dict[str, NDArray[Any]]) -> IntegerWeights:
        header = json.loads(str(arrays["metadata"]))
        formats.INTEGER.check(header)
        config = ClassifierConfig.from_dict(header["classifier"])
        names, notes = header["class_names"], header["notes"]
        if not isinstance(names, list) or len(names) != config.classes or not all(isinstance(n, str) for n in names):
            raise InputError(f"it must name its {config.classes} classes, not {names!r}")
        if not isinstance(notes, dict):
            raise InputError(f"its notes must be an object, not {notes!r}")
        network = IntegerNetwork(config, **{name: arrays[name] for name in arrays_of(config)})
        return cls(network, tuple(names), notes)


def is_integer(arrays: dict[str, NDArray[Any]]) -> bool:
    """Return True if the arrays of a file say that they are an integer network."""
    with contextlib.suppress(KeyError, TypeError, ValueError, RecursionError):
        return bool(json.loads(str(arrays["metadata"]))["format"] == formats.INTEGER.name)
    return False


def arrays_of(config: ClassifierConfig) -> dict[str, Any]:
    """Return the arrays of a network's file with their types."""
    return ARRAYS | (PARAMETERS if config.own_parameters else {})


# -- memory images -----------------------------------------------------------------------------------


def weight_image(network: IntegerNetwork) -> list[int]:
    """Return the words of the row memory: word g of row r has the address ``r << row_bits | g``.

    Row n belongs to hidden neuron n, and row ``hidden`` + c to channel c. Word g contains the weights to the neurons
    from ``g * lanes`` on, the first in the least significant bits.
    """
    config = network.config
    rows = row_image(config, network.w_in, config.weight_bits, config.input_words)
    return recurrent_image(network, config.weight_bits) + rows


def recurrent_image(network: IntegerNetwork, bits: int) -> list[int]:
    """Return the words of the recurrent weights, with ``bits`` for each weight.

    In a stack, the row of a neuron has the words with neurons that read its group, and follows the row before.
    """
    config = network.config
    if not config.layers:
        return row_image(config, network.w_rec, bits, config.recurrent_words)
    full = np.zeros((config.hidden, config.lanes * config.lane_words), np.int64)
    full[:, : config.hidden] = network.w_rec
    words = full.reshape(config.hidden, config.lane_words, config.lanes)
    return [
        packed(weights, bits)
        for group, (first, count) in zip(config.stack, config.spans, strict=True)
        for weights in words[group.start : group.end, first : first + count].reshape(-1, config.lanes).tolist()
    ]


def row_image(config: ClassifierConfig, rows: NDArray[Any], bits: int, words: int) -> list[int]:
    """Return the ``words`` words of a memory of weights, shape (rows, hidden), with ``bits`` for each weight."""
    full = np.zeros((words >> config.row_bits, config.lanes << config.row_bits), np.int64)
    full[: len(rows), : config.stack[0].end] = rows[:, : config.stack[0].end]
    return [packed(weights, bits) for weights in full.reshape(words, config.lanes).tolist()]


def neuron_image(network: IntegerNetwork) -> list[int]:
    """Return the words of the neuron memory: word k of neuron n has the address ``n << neuron_row_bits | k``.

    Words 0 to ``classes`` - 1 are its weights to the outputs, the next is its bias, and the one behind it the bias of
    output n. With own parameters the threshold stands above the bias, and the leak shift above the threshold.
    """
    config = network.config
    hidden, classes = config.hidden, config.classes
    table = np.zeros((max(hidden, classes), 1 << config.neuron_row_bits), np.int64)
    above = np.zeros_like(table)
    above[:, classes:][:, :2] = np.reshape(parameter_image(network), (-1, 2)) if config.own_parameters else 0
    table[:hidden, :classes], table[:hidden, classes] = network.w_out, network.b_hidden
    table[:classes, classes + 1] = network.b_out
    words = zip(table.ravel().tolist(), above.ravel().tolist(), strict=True)
    return [packed([low], config.neuron_weight_bits) | high << config.neuron_weight_bits for low, high in words]


def parameter_image(network: IntegerNetwork) -> list[int]:
    """Return the words of the memory of own parameters: word 2 n of hidden neuron n, word 2 n + 1 of output n."""
    config = network.config
    table = np.zeros((max(config.hidden, config.classes), 2), np.int64)
    table[: config.hidden, 0] = network.threshold | network.leak << config.threshold_bits
    table[: config.classes, 1] = network.out_threshold | network.out_leak << config.threshold_bits
    words: list[int] = table.ravel().tolist()
    return words


def network_of(config: ClassifierConfig, weights: Sequence[int], neurons: Sequence[int]) -> IntegerNetwork:
    """Return the network stored in two memory images."""
    rows = np.array([unpacked(word, config.lanes, config.weight_bits) for word in weights])
    recurrent, inputs = np.split(rows, [config.recurrent_words])
    w_in = _placed(config, inputs.reshape(config.inputs, -1), 0)
    parts = []
    for group, (first, count) in zip(config.stack, config.spans, strict=True):
        words, recurrent = np.split(
            recurrent, [(group.end - group.start) * (count if config.layers else 1 << config.row_bits)]
        )
        parts.append(_placed(config, words.reshape(group.end - group.start, -1), first * config.lanes))
    bits, shape = config.neuron_weight_bits, (-1, 1 << config.neuron_row_bits)
    table = np.array([unpacked(word, 1, bits) for word in neurons]).reshape(shape)
    hidden, classes = config.hidden, config.classes
    own = {}
    if config.own_parameters:
        above = np.array([word >> bits for word in neurons]).reshape(shape)
        shifts, thresholds = above >> config.threshold_bits, above & (1 << config.threshold_bits) - 1
        own = {"threshold": thresholds[:hidden, classes], "leak": shifts[:hidden, classes]}
        own |= {"out_threshold": thresholds[:classes, classes + 1], "out_leak": shifts[:classes, classes + 1]}
    return IntegerNetwork(
        config,
        w_in=w_in,
        w_rec=np.concatenate(parts),
        w_out=table[:hidden, :classes],
        b_hidden=table[:hidden, classes],
        b_out=table[:classes, classes + 1],
        **own,
    )


def _placed(config: ClassifierConfig, rows: NDArray[Any], first: int) -> NDArray[Any]:
    """Return rows of weights to all hidden neurons, whose first weight goes to a neuron."""
    full = np.zeros((len(rows), max(config.hidden, first + rows.shape[1])), np.int64)
    full[:, first : first + rows.shape[1]] = rows
    return full[:, : config.hidden]


def write_images(network: IntegerNetwork, folder: Path, name: str) -> list[Path]:
    """Write both memory images for ``$readmemh`` and return their paths."""
    config, paths = network.config, []
    images = {
        "weights": (weight_image(network), config.lanes * config.weight_bits),
        "neurons": (neuron_image(network), config.neuron_bits),
    }
    for kind, (image, bits) in images.items():
        paths.append(folder / f"{name}.{kind}.hex")
        check_file(paths[-1])
        digits = -(-bits // 4)
        with atomic_write(paths[-1]) as file:
            file.write("".join(f"{word:0{digits}x}\n" for word in image).encode())
    return paths
