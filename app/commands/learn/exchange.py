"""The commands export, import and quantise (docs/guide/exchange.md)."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING

from eskin.app.cli import echo, printable
from eskin.app.options import TRAINED, arg, command, opt, out_file
from eskin.base.errors import InputError
from eskin.base.progress import bar

if TYPE_CHECKING:
    from eskin.snn.exchange.weights import Weights


@command("Classifier", needs="snn events", fuzz="good/train/weights.npz -o new.nir")
def export(
    out: Path = out_file(..., "FILE", "graph .nir, or archive .npz"),
    weights: Path = arg(TRAINED, "WEIGHTS.npz", "trained network"),
    eight_bits: bool = opt(False, "--eight-bits", ".npz: matrices in 8 bits"),
) -> None:
    """Export a trained network as a NIR graph or a NumPy archive."""
    if out.suffix not in (".nir", ".npz"):
        raise InputError(f"networks end in .nir or .npz, but {out.name} does not; rename the output")
    if eight_bits and out.suffix == ".nir":
        raise InputError("NIR has no 8-bit weights; write an .npz, or leave --eight-bits out")
    from eskin.snn.exchange.nir_network import save_nir
    from eskin.snn.exchange.weights import load_weights, save_weights

    loaded = load_weights(weights)
    if out.suffix == ".nir":
        save_nir(out, loaded)
    else:
        save_weights(out, loaded, eight_bits)
    echo(f"{out}: {len(loaded.class_names)} classes, {loaded.step_s:g} s per step, {out.stat().st_size} bytes")
    if out.suffix == ".nir":
        _tell_lacks(weights, loaded)


def _tell_lacks(path: Path, weights: Weights) -> None:
    """Print the network features that snnTorch and Norse lack, and the test accuracy without these features."""
    from eskin.snn.exchange.portable import lacks
    from eskin.snn.exchange.weights import config_of

    if (scale := config_of(weights.network).input_scale) != 1:
        print(
            f"input scale {scale:.4g}: included in the weights of hidden_in, because snnTorch and Norse have no Scale"
        )
    found = lacks(weights.network)
    if not found:
        print(
            "snnTorch and Norse support every feature of this network: docs/guide/exchange.md shows how to run it there"
        )
        return
    for lack in found:
        print(lack.text)
    print("eskin train --recipe portable trains networks without these features")
    from eskin.snn.experiments.trained import accuracies_on_test

    networks = {"here": weights.network} | {f"without {lack.name}": lack.network for lack in found}
    try:
        with bar("recording scans") as step:
            images, accuracies = accuracies_on_test(path, weights, networks, step)
    except InputError as error:
        echo(f"the loss of accuracy was not measured: {error}")
        return
    parts = [f"{accuracy:.1%} {words}" for words, accuracy in accuracies.items()]
    print(f"accuracy of the {images} test images: {', then '.join(parts)}")


@command("Classifier", needs="snn events", fuzz="good/network.nir -o new.npz")
def import_(
    graph: Path = arg(..., "GRAPH.nir", "NIR graph of a network"),
    out: Path = out_file(..., "WEIGHTS.npz", "archive to write"),
    step: float | None = opt(None, "SECONDS", "time step, if the file has none"),
    classes: str | None = opt(None, "A,B,...", "names of the outputs [those in the file, or numbers]"),
    reset: str | None = opt(None, "zero|subtract|delayed", "effect of a spike, if the file has none [zero]"),
) -> None:
    """Import a network from a NIR graph."""
    if out.suffix != ".npz":
        raise InputError(f"weight files end in .npz, but {out.name} does not; rename the output")
    from eskin.snn.exchange.nir_network import assumption, load_nir
    from eskin.snn.exchange.weights import config_of, save_weights

    loaded = load_nir(graph, step, None if classes is None else classes.split(","), reset)
    save_weights(out, loaded)
    network = config_of(loaded.network)
    names = printable(", ".join(loaded.class_names))
    layers = f" in layers of {', '.join(map(str, network.layers))}" if network.layers else ""
    echo(f"{out}: {network.inputs} inputs, {network.hidden} hidden neurons{layers}, classes {names}")
    if reset is None and (said := assumption(graph, loaded)):
        echo(said)


@command(
    "Classifier",
    needs="snn",
    fuzz="good/train/weights.npz -o new.npz",
    idle={
        "--in-bits & --rec-bits & --out-bits": "--bits",
    },
)
def quantise(
    weights: Path = arg(TRAINED, "WEIGHTS.npz", "trained network"),
    bits: int = opt(8, "bits of all weights", min=2, max=8),
    in_bits: int | None = opt(None, "2..8", "bits of the input weights"),
    rec_bits: int | None = opt(None, "2..8", "bits of the recurrent weights"),
    out_bits: int | None = opt(None, "2..8", "bits of the output weights"),
    bias_bits: int = opt(9, "bits of a bias, 2..16"),
    decay_bits: int | None = opt(None, "bits of a decay, 2..16 [a shift; 8 with synaptic currents]"),
    threshold_bits: int = opt(8, "smallest number of bits of the threshold, 2..16"),
    membrane_bits: int | None = opt(
        None, "bits of a hidden potential [32 thresholds; no floor, or synaptic currents: all values]"
    ),
    lanes: int = opt(16, "weights added per clock"),
    margin: int = opt(
        0, "N", "lead of the evidence for an early decision, a port of the hardware [none]", min=0, max=2**32 - 1
    ),
    clock: float | None = opt(
        None, "HZ", "clock frequency of the hardware [50e6; own recordings: the lowest that suffices]"
    ),
    accuracy: bool = opt(False, "--accuracy", "print the accuracy of float and integer network on the test images"),
    out: Path | None = out_file(
        None, "INTEGER.npz", "file to write; memory images are written beside it [whole.npz beside the weights]"
    ),
) -> None:
    """Quantise a trained network to integers for the hardware classifier, and write its memory images."""
    out = out or weights.with_name("whole.npz")
    if out.suffix != ".npz":
        raise InputError(f"integer networks end in .npz, but {out.name} does not; rename the output")
    from eskin.model.classifier.chip_config import with_room
    from eskin.model.classifier.file import write_images
    from eskin.model.config import ReadoutConfig
    from eskin.snn.exchange.integer import Precision, quantise, summary
    from eskin.snn.exchange.weights import load_weights
    from eskin.snn.experiments.trained import said_of_training

    given = {"in_bits": in_bits, "rec_bits": rec_bits, "out_bits": out_bits}
    precision = Precision(
        **{name: bits if value is None else value for name, value in given.items()},
        bias_bits=bias_bits,
        decay_bits=decay_bits,
        threshold_bits=threshold_bits,
        membrane_bits=membrane_bits,
        lanes=lanes,
        margin=margin,
        clock_hz=50e6 if clock is None else clock,
        narrow=True,
    )
    trained = load_weights(weights)
    said = said_of_training(weights, trained)
    made = quantise(trained, precision)
    if said.get("recordings"):
        readout = with_room(ReadoutConfig.from_dict(said["readout"]), made.network.config)
        said |= {"readout": readout.to_dict()}
        if clock is None:
            made = quantise(trained, dataclasses.replace(precision, clock_hz=readout.clock_hz))
    made = dataclasses.replace(made, notes=made.notes | {"training": said})
    lines = summary(made)
    if accuracy:
        from eskin.snn.experiments.evaluate import compare_integer

        lines.append(compare_integer(weights, made))
    made.save(out)
    images = write_images(made.network, out.parent, out.stem)
    for line in lines:
        echo(line)
    echo(f"written: {', '.join(str(path) for path in [out, *images])}")
