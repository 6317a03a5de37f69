"""Convert trained networks to and from NIR, the Neuromorphic Intermediate Representation (docs/guide/exchange.md).

NIR states neurons by differential equations (Pedersen et al., Nature Communications 15, 8122, 2024). Here and in
snnTorch they are solved by the forward Euler method, the input current I being held during a step dt::

    LI, LIF   tau dv/dt = v_leak - v + r I   v <- (1 - dt / tau) v + dt / tau (v_leak + r I)
    I, IF     dv/dt = r I                    v <- v + r I         r per step, as snnTorch reads it
    CubaLIF   tau_syn dJ/dt = w_in I - J     J <- (1 - dt / tau_syn) J + dt / tau_syn w_in I
              tau_mem dv/dt = v_leak - v + r J                    then v of the new J, as in LIF

so that a membrane with the fraction ``decay`` of its potential left has tau = dt / (1 - decay). The file has r = 1 and
no input scale: both are multiplied into the preceding weights and biases, in float64, because other programs ignore r
or lack a node for a scale. Dividing again in float64 restores the float32 weights bit for bit. A CubaLIF has
r = tau_mem / dt and w_in = tau_syn / dt, as snnTorch demands, so its weights stay as they are.
"""

import io
import itertools
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, get_args

import nir
import numpy as np
import torch
from numpy.typing import NDArray

from eskin.base import formats
from eskin.base.errors import InputError
from eskin.base.files import atomic_write
from eskin.snn.exchange.hdf5 import read_hdf5
from eskin.snn.exchange.nir_layers import INPUT, Layer, affine, broadcast, follow
from eskin.snn.exchange.weights import Weights, check_class_names, check_step, config_of
from eskin.snn.kernels.rule import NetworkReset
from eskin.snn.network import SpikingNetwork, build
from eskin.snn.network_config import NetworkConfig

SMALLEST_LOSS = 2.0**-60
"""Part of the potential that a learned decay of exactly 1 loses in a step, so that tau stays finite."""

MAX_DECAY_ERROR = 1e-6
"""Largest difference between the decay of a time constant and the decay in the metadata."""

FOLDED = "input_scale"
"""Metadata of the first linear node: the scale of the inputs that its weights hold."""

HIDDEN_IN, HIDDEN = "hidden_in", "hidden"
RECURRENT, READOUT_IN, READOUT, OUTPUT = "recurrent", "readout_in", "readout", "output"


def to_nir(weights: Weights) -> nir.NIRGraph:
    """Return the NIR graph of a trained spiking network.

    Metadata contain everything that NIR cannot express: ``floor`` and ``reset`` of every neuron, ``raw_decay`` for
    learned decays, and in the graph ``dt``, ``output_scale`` and, as JSON, all of ``NetworkConfig``.

    Raise InputError if the network is a baseline for frames.
    """
    network, config = weights.network, config_of(weights.network)
    if not isinstance(network, SpikingNetwork):
        raise InputError(f"a network of kind {config.kind} has no NIR neurons; export it as .npz")
    if config.layers:
        raise InputError("export writes networks of one hidden layer as NIR; export this stack as .npz")
    if config.weight_bits:
        raise InputError(
            f"the network rounds its weights to {config.weight_bits} bits, which NIR cannot express; export it as .npz"
        )
    if not math.isfinite(weights.step_s / SMALLEST_LOSS):
        raise InputError(
            f"a time step of {weights.step_s:g} s gives time constants that NIR cannot store; "
            f"export the network as .npz"
        )
    arrays = {name: tensor.detach().cpu().numpy() for name, tensor in network.state_dict().items()}
    decay, output_decay = (tensor.detach().cpu().numpy() for tensor in network.decays())
    synapse, output_synapse = config.synapse_decay, config.output_synapse_decay
    gain, output_gain = _gain(decay, synapse), _gain(output_decay, output_synapse)
    neuron: dict[str, Any] = {"floor": config.floor, "reset": config.reset}
    fires = config.readout == "spikes"
    read = dict(neuron) if fires else {}
    if config.learn_decay:
        neuron = neuron | {"raw_decay": arrays["raw_decay"]}
        read = read | {"raw_decay": arrays["raw_output_decay"]}
    if (synapse and (decay == 1).any()) or (output_synapse and (not fires or (output_decay == 1).any())):
        raise InputError("NIR has synaptic currents only in neurons that leak and fire; export it as .npz")
    nodes: dict[str, nir.NIRNode] = {
        INPUT: nir.Input(input_type={"input": np.array([config.inputs])}),
        HIDDEN_IN: nir.Affine(
            weight=arrays["w_in"] * (config.input_scale * gain[:, None]),
            bias=arrays["b_hidden"] * gain,
            metadata={FOLDED: config.input_scale},
        ),
        HIDDEN: _neurons(decay, synapse, weights.step_s, True, neuron),
        RECURRENT: nir.Linear(weight=arrays["w_rec"] * gain[:, None]),
        READOUT_IN: nir.Affine(weight=arrays["w_out"] * output_gain[:, None], bias=arrays["b_out"] * output_gain),
        READOUT: _neurons(output_decay, output_synapse, weights.step_s, fires, read),
        OUTPUT: nir.Output(output_type={"output": np.array([config.classes])}),
    }
    header = {"network": config.to_dict(), "class_names": list(weights.class_names), "step_s": weights.step_s}
    metadata = {
        "format": formats.NETWORK.name,
        "format_version": formats.NETWORK.version,
        "dt": weights.step_s,
        "output_scale": config.output_scale,
        "logits": f"output_scale * {'sum' if fires else 'mean'} over time of node {READOUT}",
        "header": json.dumps(header),
    }
    chain = [INPUT, HIDDEN_IN, HIDDEN, READOUT_IN, READOUT, OUTPUT]
    edges = [*itertools.pairwise(chain), (HIDDEN, RECURRENT), (RECURRENT, HIDDEN)]
    return nir.NIRGraph(nodes, edges, metadata)


def save_nir(path: Path | str, weights: Weights) -> None:
    """Write a network as a NIR file (HDF5).

    Raise InputError if the name does not end in .nir, the network is a baseline, or the file cannot be written.
    """
    path = Path(path)
    if path.suffix != ".nir":
        raise InputError(f"NIR files end in .nir, but {path.name} does not; rename the output")
    data = io.BytesIO()
    nir.write(data, to_nir(weights))
    with atomic_write(path) as file:
        file.write(data.getvalue())


def _neurons(decay: NDArray[Any], synapse: float, step_s: float, fires: bool, metadata: dict[str, Any]) -> nir.NIRNode:
    """Return a NIR node of neurons with threshold 1, or of non-spiking membranes."""
    one, zero = np.ones(len(decay)), np.zeros(len(decay))
    if (decay == 1).all():
        if not fires:
            return nir.I(r=one, metadata=metadata)
        return nir.IF(r=one, v_threshold=one, v_reset=zero, metadata=metadata)
    if synapse:
        r, w_in = 1.0 / (1.0 - decay.astype(np.float64)), one / (1.0 - synapse)
        tau = {"tau_mem": step_s * r, "tau_syn": step_s * w_in, "r": r, "w_in": w_in}
        return nir.CubaLIF(**tau, v_leak=zero, v_threshold=one, v_reset=zero, metadata=metadata)
    leak = {"tau": step_s * _gain(decay), "r": one, "v_leak": zero}
    if not fires:
        return nir.LI(**leak, metadata=metadata)
    return nir.LIF(**leak, v_threshold=one, v_reset=zero, metadata=metadata)


def _gain(decay: NDArray[Any], synapse: float = 0.0) -> NDArray[np.float64]:
    """Return the current gain that compensates the factor (1 - decay) of NIR neurons."""
    if (decay == 1).all() or synapse:
        return np.ones(len(decay))
    return 1.0 / np.maximum(1.0 - decay.astype(np.float64), SMALLEST_LOSS)


def load_nir(
    path: Path | str, step_s: float | None = None, class_names: Sequence[str] | None = None, reset: str | None = None
) -> Weights:
    """Return the network from a NIR file.

    Raise InputError if the file cannot be read, is damaged, or contains a graph that the network cannot express; the
    text names the node.

    - ``step_s``: seconds per time step, required if the file's metadata have no ``dt``.
    - ``class_names``: names of the outputs, by default those in the file, or else their numbers.
    - ``reset``: "zero", "subtract" or "delayed". Effect of a spike on neurons whose metadata do not have it, zero by
      default: NIR has no reset by subtraction. "delayed" is the default of snnTorch's ``Leaky``.
    """
    data = read_hdf5(Path(path), "a NIR graph; export it again")
    try:
        graph = nir.read(io.BytesIO(data), type_check=False)  # from_nir checks, and names the node
    except Exception:  # a damaged file makes h5py and nir raise almost any type
        raise InputError(f"{path} is damaged or not a NIR graph; export it again") from None
    try:
        return from_nir(graph, step_s, class_names, reset)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def from_nir(
    graph: nir.NIRGraph, step_s: float | None = None, class_names: Sequence[str] | None = None, reset: str | None = None
) -> Weights:
    """Return the network for a NIR graph; parameters and errors as for ``load_nir``."""
    try:
        graph.validate_structure()
    except ValueError as error:
        raise InputError(f"the graph is incomplete: {error}") from None
    header = _header(graph)
    dt = _time_step(graph, step_s)
    if reset not in (None, *get_args(NetworkReset)):
        raise InputError(f"the reset must be zero, subtract or delayed, not {reset!r}")
    hidden, readout, w_rec, input_scale = _layers(graph, dt, reset)
    if reset is not None and reset != hidden[0].reset:
        raise InputError(f"the graph already sets the reset {hidden[0].reset}, not {reset}; leave --reset out")
    config, names = _config_of(hidden, readout, input_scale, header)
    names = names if class_names is None else class_names
    if isinstance(names, (list, tuple)) and len(names) != config.classes:
        raise InputError(
            f"node {readout.name!r} has {config.classes} outputs, not {len(names)}; give a class name for each output"
        )
    class_names = check_class_names(names, config.classes)
    network = build(config, seed=0)
    assert isinstance(network, SpikingNetwork)
    sizes = [len(layer.decay) for layer in hidden]
    w_in, w_out = np.zeros((sum(sizes), config.inputs)), np.zeros((config.classes, sum(sizes)))
    w_in[: sizes[0]], w_out[:, -sizes[-1] :] = hidden[0].weight, readout.weight
    bias = np.concatenate([layer.bias for layer in hidden])
    state = {"w_in": w_in, "b_hidden": bias, "w_rec": w_rec, "w_out": w_out, "b_out": readout.bias}
    if config.learn_decay:
        raw = np.concatenate([layer.logits() for layer in hidden])
        state |= {"raw_decay": raw, "raw_output_decay": readout.logits()}
    with np.errstate(over="ignore"):
        arrays = {name: array.astype(np.float32) for name, array in state.items()}
    if wrong := [name for name, array in arrays.items() if not np.isfinite(array).all()]:
        raise InputError(f"the graph gives {wrong[0]} values beyond float32; export it again")
    network.load_state_dict({name: torch.from_numpy(array) for name, array in arrays.items()})
    made, made_output = (decays.detach().numpy() for decays in network.decays())
    parts = [*np.split(made, np.cumsum(sizes)[:-1]), made_output]
    for layer, kept in zip((*hidden, readout), parts, strict=True):
        if np.abs(kept - layer.decay).max() > MAX_DECAY_ERROR:
            raise InputError(
                f"node {layer.name!r} has a tau that contradicts the decay in the metadata; remove the metadata"
            )
    return Weights(network, class_names, dt)


def assumption(path: Path, weights: Weights) -> str:
    """Return the assumption about the effect of a spike in a NIR file that does not state it; an empty text if it does.

    ``weights`` is the network that ``load_nir`` made of the file.
    """
    graph = nir.read(io.BytesIO(read_hdf5(path, "a NIR graph; export it again")), type_check=False)
    firing = [node for node in graph.nodes.values() if hasattr(node, "v_threshold")]
    if all("reset" in node.metadata for node in firing):
        return ""
    reset = config_of(weights.network).reset
    text = f"assumed: a spike resets the potential by {reset!r}, because the graph does not say so"
    return f"{text}; snnTorch's Leaky needs --reset delayed unless reset_mechanism and reset_delay were given"


def _number(metadata: dict[str, Any], name: str, default: Any) -> Any:
    """Return a value of the metadata, as plain Python if it is a number of NumPy."""
    value = metadata.get(name, default)
    return value.item() if isinstance(value, np.generic) else value


def _time_step(graph: nir.NIRGraph, step_s: float | None) -> float:
    """Return the time step of a graph in seconds, or the given time step if the graph has none."""
    own = _number(graph.metadata, "dt", None)
    steps = [check_step(step) for step in (own, step_s) if step is not None]
    if not steps:
        raise InputError("the graph has no time step; give it in seconds (--step)")
    if not math.isclose(steps[0], steps[-1]):
        raise InputError(f"the graph has a time step of {own:g} s, not {step_s:g} s; leave --step out")
    return steps[0]


def _layers(graph: nir.NIRGraph, dt: float, reset: str | None) -> tuple[list[Layer], Layer, NDArray[np.float64], float]:
    """Return hidden layers and output layer, recurrent weights and input scale of a graph.

    Raise InputError for unsupported nodes.
    """
    chain = follow(graph)
    first = chain.hidden[0].linear
    w_in, b_in = affine(graph, first)
    input_scale = _folded(graph.nodes[first])
    w_in = w_in / input_scale
    if chain.scale is not None:
        scale = broadcast(chain.scale, graph.nodes[chain.scale].scale, w_in.shape[1])
        if scale[0] > 0 and (scale == scale[0]).all():
            input_scale *= float(scale[0])
        else:
            w_in = w_in * scale
    layers: list[Layer] = []
    recurrent = []
    for part in (*chain.hidden, chain.readout):
        weight, bias = affine(graph, part.linear) if layers else (w_in, b_in)
        size = len(weight)
        w_rec, b_rec = (np.zeros((size, size)), 0.0) if part.recurrent is None else affine(graph, part.recurrent)
        shapes = [(part.recurrent, w_rec, part.neurons, size)]
        if layers:
            shapes.append((part.linear, weight, layers[-1].name, len(layers[-1].decay)))
        for name, matrix, neurons, wanted in shapes:
            if matrix.shape != (size, wanted):
                raise InputError(
                    f"node {name!r} has weights of shape {matrix.shape}, but node {neurons!r} has {wanted} neurons"
                )
        layers.append(Layer.of(part.neurons, graph.nodes[part.neurons], dt, weight, bias + b_rec, reset))
        recurrent.append(w_rec * layers[-1].gain[:, None])
    *hidden, readout = layers
    for one in layers:
        if one.fires and (one.floor, one.reset) != (hidden[0].floor, hidden[0].reset):
            raise InputError(f"nodes {hidden[0].name!r} and {one.name!r} differ in floor or reset; make them equal")
        if one.reset == "delayed" and one.synapse_decay:
            raise InputError(f"node {one.name!r} has a synaptic current, so its reset must be zero or subtract")
    for one in hidden:
        if abs(one.synapse_decay - hidden[0].synapse_decay) > MAX_DECAY_ERROR:
            raise InputError(f"nodes {hidden[0].name!r} and {one.name!r} differ in tau_syn; the network has one")
    return hidden, readout, _blocks(hidden, recurrent[:-1]), input_scale


def _blocks(layers: list[Layer], recurrent: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return the recurrent weights of a stack: those of each layer, and those from each layer to the next."""
    ends = np.cumsum([len(layer.decay) for layer in layers]).tolist()
    found = np.zeros((ends[-1], ends[-1]))
    start = 0
    for layer, own, end in zip(layers, recurrent, ends, strict=True):
        found[start:end, start:end] = own
        if start:
            found[start:end, start - layer.weight.shape[1] : start] = layer.weight
        start = end
    return found


def _folded(node: nir.NIRNode) -> float:
    """Return the input scale contained in the weights of the first node, 1 by default."""
    value = _number(node.metadata, FOLDED, 1.0)
    if type(value) not in (int, float) or not (math.isfinite(value) and value > 0):
        raise InputError(f"the weights of the first node hold an {FOLDED} of {value!r}, which is not a positive number")
    return float(value)


def _config_of(
    hidden: list[Layer], readout: Layer, input_scale: float, header: dict[str, Any] | None
) -> tuple[NetworkConfig, Sequence[str]]:
    """Return configuration and class names from the metadata, after checking them against the nodes."""
    sizes = tuple(len(layer.decay) for layer in hidden)
    synapses = {"synapse_decay": hidden[0].synapse_decay, "output_synapse_decay": readout.synapse_decay}
    found = synapses | {
        "inputs": hidden[0].weight.shape[1],
        "hidden": sum(sizes),
        "layers": sizes if len(sizes) > 1 else (),
        "classes": len(readout.decay),
        "input_scale": input_scale,
        "floor": hidden[0].floor,
        "reset": hidden[0].reset,
        "readout": "spikes" if readout.fires else "membrane",
    }
    if header is None:
        config = NetworkConfig.from_dict(found | _decay_fields(hidden, readout))
        return config, [str(number) for number in range(config.classes)]
    try:
        config, names = NetworkConfig.from_dict(header["network"]), header["class_names"]
    except (KeyError, InputError):
        raise InputError("the metadata of the graph are damaged; export it again") from None
    for name, value in found.items():
        stated = getattr(config, name)
        if abs(stated - value) > MAX_DECAY_ERROR if name in synapses else stated != value:
            shown = [f"{number:g}" if name in synapses else str(number) for number in (value, stated)]
            raise InputError(
                f"the nodes of the graph give {name} = {shown[0]}, but its metadata give {shown[1]}; "
                f"remove the metadata of the graph"
            )
    return config, names


def _decay_fields(hidden: list[Layer], readout: Layer) -> dict[str, Any]:
    """Return the decay fields of NetworkConfig; decays that vary among hidden or output neurons become learned ones."""
    common = hidden[0].decay[0]
    differ = [layer for layer in hidden if (layer.decay != common).any()]
    differ += [readout] if np.ptp(readout.decay) else []
    for layer in (*hidden, readout) if differ else ():
        if (layer.decay == 1).any():
            raise InputError(
                f"node {layer.name!r} has no leak, while those of {differ[0].name!r} differ; give it a long tau"
            )
    return {"decay": float(common), "output_decay": float(readout.decay[0]), "learn_decay": bool(differ)}


def _header(graph: nir.NIRGraph) -> dict[str, Any] | None:
    """Return the metadata of a graph made by ``to_nir``, or None for other graphs."""
    if graph.metadata.get("format") != formats.NETWORK.name:
        return None
    if (version := graph.metadata.get("format_version")) != formats.NETWORK.version:
        raise InputError(
            f"the graph has format version {version}; this program reads version {formats.NETWORK.version}"
        )
    try:
        header = json.loads(graph.metadata["header"])
    except (KeyError, TypeError, ValueError):
        header = None
    if not isinstance(header, dict):
        raise InputError("the metadata of the graph are damaged; export it again")
    return header
