"""Read a NIR graph as layers of neurons in discrete time with threshold 1.

``eskin.snn.exchange.nir_network`` describes the discretisation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import nir
import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError

INPUT = "input"
"""Name of the first node of our graphs and data."""

_LINEAR = (nir.Affine, nir.Linear)
_FIRING = (nir.IF, nir.LIF, nir.CubaLIF)
_NEURONS = (*_FIRING, nir.I, nir.LI)


class Part(NamedTuple):
    """Names of the nodes of one layer; None without recurrent connections."""

    linear: str
    neurons: str
    recurrent: str | None


class Chain(NamedTuple):
    """Names of the nodes of a graph, from input to output; None for a scale that it lacks."""

    scale: str | None
    hidden: list[Part]
    readout: Part


def follow(graph: nir.NIRGraph) -> Chain:
    """Return the nodes of a graph in signal order; raise InputError for an unsupported structure."""
    if len(graph.inputs) != 1:
        raise InputError(f"the graph has {len(graph.inputs)} nodes of type Input; it needs one")
    after: dict[str, list[str]] = {name: [] for name in graph.nodes}
    for source, target in graph.edges:
        after[source].append(target)
    (place,) = graph.inputs
    seen = {place}

    def check(name: str, *types: type) -> None:
        if not isinstance(graph.nodes[name], types):
            wanted = " or ".join(kind.__name__ for kind in types)
            raise InputError(
                f"node {name!r} is of type {type(graph.nodes[name]).__name__}, where the network has {wanted}"
            )

    def advance(*types: type) -> str:
        nonlocal place
        forward = [name for name in after[place] if name not in seen]
        if len(forward) != 1:
            count = len(forward) or "no"
            raise InputError(f"node {place!r} leads to {count} further nodes; it must lead to one")
        place = forward[0]
        seen.add(place)
        check(place, *types)
        return place

    def part(linear: str, *types: type) -> Part:
        neurons = advance(*types)
        loops = [name for name in after[neurons] if after[name] == [neurons]]
        if any(isinstance(graph.nodes[name], nir.Output) for name in after[neurons]):
            return Part(linear, neurons, None)  # a loop of the outputs is a further node
        if len(loops) > 1:
            raise InputError(f"node {neurons!r} has {len(loops)} recurrent connections; the network has one")
        for name in loops:
            check(name, *_LINEAR)
        seen.update(loops)
        return Part(linear, neurons, loops[0] if loops else None)

    first = advance(nir.Scale, *_LINEAR)
    scale = first if isinstance(graph.nodes[first], nir.Scale) else None
    parts = [part(first if scale is None else advance(*_LINEAR), *_FIRING)]
    while len(parts) == 1 or not any(isinstance(graph.nodes[name], nir.Output) for name in after[place]):
        check(parts[-1].neurons, *_FIRING)
        parts.append(part(advance(*_LINEAR), *_NEURONS))
    advance(nir.Output)
    if unused := sorted(set(graph.nodes) - seen):
        raise InputError(f"node {unused[0]!r} is not on the path from input to output; remove it")
    expected = len(seen) - 1 + sum(one.recurrent is not None for one in parts)
    if len(graph.edges) != expected:
        raise InputError(
            f"the graph has {len(graph.edges)} edges, where the network has {expected}; remove other loops"
        )
    return Chain(scale, parts[:-1], parts[-1])


def affine(graph: nir.NIRGraph, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return weight and bias of a linear node."""
    node = graph.nodes[name]
    weight = np.asarray(node.weight, np.float64)
    if weight.ndim != 2:
        raise InputError(f"node {name!r} has weights of shape {weight.shape}; the network has matrices")
    bias = broadcast(name, node.bias if isinstance(node, nir.Affine) else 0.0, len(weight))
    if not (np.isfinite(weight).all() and np.isfinite(bias).all()):
        raise InputError(f"node {name!r} has weights that are not finite numbers; export it again")
    return weight, bias


def broadcast(name: str, values: Any, size: int) -> NDArray[np.float64]:
    """Return a node parameter as an array with one value per channel."""
    try:
        return np.broadcast_to(np.asarray(values, np.float64), size)
    except ValueError:
        raise InputError(f"node {name!r} has parameters of shape {np.shape(values)}, not ({size},)") from None


@dataclass(frozen=True)
class Layer:
    """Neurons of a NIR node in discrete time, scaled to threshold 1, with the weights and biases before them."""

    name: str
    fires: bool
    decay: NDArray[np.float64]
    gain: NDArray[np.float64]
    """v <- decay v + gain I + drive, the drive being part of the bias. Shape (neurons,)."""
    weight: NDArray[np.float64]
    bias: NDArray[np.float64]
    """Input weights and biases, times the gain. Shapes (neurons, inputs) and (neurons,)."""
    synapse_decay: float
    """With a synaptic current J: J <- synapse_decay J + gain I, v <- decay v + J; else 0."""
    floor: float
    reset: str
    raw: NDArray[np.float64] | None
    """Learned decays before the logistic function, if the file has them."""

    @classmethod
    @np.errstate(divide="ignore")  # a tau of 0 is refused
    def of(
        cls,
        name: str,
        node: nir.NIRNode,
        dt: float,
        weight: NDArray[np.float64],
        bias: NDArray[np.float64],
        reset: str | None,
    ) -> Layer:
        """Return the neurons of a NIR node; raise InputError for an unsupported neuron type.

        ``reset`` is the reset of neurons whose metadata have none, zero by default.
        """
        size = len(weight)

        def values(parameter: str, default: float = 0.0) -> NDArray[np.float64]:
            return broadcast(name, getattr(node, parameter, default), size)

        raw = broadcast(name, node.metadata["raw_decay"], size) if "raw_decay" in node.metadata else None
        part, decay, synapse = np.ones(size), np.ones(size), np.ones(size)
        if isinstance(node, nir.CubaLIF):
            synapse = dt / values("tau_syn")
            if not ((synapse > 0) & (synapse <= 1)).all():
                raise InputError(f"node {name!r} has a tau_syn below {dt:g} s; choose a shorter time step")
            if np.ptp(synapse) > 1e-6:
                raise InputError(f"node {name!r} has a tau_syn for each neuron; the network has one")
            if np.any(node.v_leak):
                raise InputError(f"node {name!r} has a synaptic current and a v_leak other than 0; the network has 0")
        if isinstance(node, (nir.LIF, nir.LI, nir.CubaLIF)):
            part = dt / values("tau_mem" if isinstance(node, nir.CubaLIF) else "tau")
            decay = 1.0 - part
            if not ((part > 0) & ((part < 1) | ((part == 1) & (raw is not None)))).all():
                raise InputError(f"node {name!r} has a tau that is not above {dt:g} s; choose a shorter time step")
        threshold = values("v_threshold", 1.0)
        if not (threshold > 0).all():
            raise InputError(f"node {name!r} has a v_threshold that is not positive; the network needs one")
        if np.any(values("v_reset")):
            raise InputError(f"node {name!r} has a v_reset other than 0; the network resets to 0")
        try:
            floors = np.unique(float(node.metadata.get("floor", -math.inf)) / threshold)
        except (TypeError, ValueError):
            raise InputError(f"node {name!r} has a floor that is not a number; export it again") from None
        if len(floors) > 1:
            raise InputError(f"node {name!r} has a floor and different thresholds, but the network has one floor")
        gain = synapse * values("w_in", 1.0) * part * values("r") / threshold
        return cls(
            name=name,
            fires=isinstance(node, _FIRING),
            decay=decay,
            gain=gain,
            weight=weight * gain[:, None],
            bias=bias * gain + part * values("v_leak") / threshold,
            synapse_decay=float(1.0 - synapse[0]),
            floor=float(floors[0]),
            reset=str(node.metadata.get("reset", reset or "zero")),
            raw=raw,
        )

    def logits(self) -> NDArray[np.float64]:
        """Return decays before the logistic function (logits)."""
        return np.log(self.decay / (1.0 - self.decay)) if self.raw is None else self.raw
