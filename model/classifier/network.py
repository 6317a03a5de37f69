"""Model of the integer network, bit-exact in every bin (docs/reference/classifier.md).

This is the golden model of ``rtl/classifier``, without lanes and words.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.model.classifier.config import MAX_BITS, ClassifierConfig, Leak, bits_of, highest, lowest

Whole = NDArray[np.int64]


class Bin(NamedTuple):
    """Potentials, spikes (0 or 1) and evidence at the end of a bin."""

    potential: Whole  # as compared with the threshold, shape (hidden,)
    spikes: Whole  # shape (hidden,)
    output: Whole  # shape (classes,)
    output_spikes: Whole  # shape (classes,); membrane outputs never spike
    evidence: Whole  # since the scan began, shape (classes,)
    winner: int  # the class: the first output with the most evidence


def _arrays(config: ClassifierConfig) -> dict[str, tuple[tuple[int, ...], int]]:
    """Return the shape and the bit width of every weight array of a network."""
    return {
        "w_in": ((config.inputs, config.hidden), config.in_bits),
        "w_rec": ((config.hidden, config.hidden), config.rec_bits),
        "w_out": ((config.hidden, config.classes), config.out_bits),
        "b_hidden": ((config.hidden,), config.bias_bits),
        "b_out": ((config.classes,), config.bias_bits),
    }


@dataclass(frozen=True, eq=False)
class IntegerNetwork:
    """A spiking network with integer weights.

    Raises InputError if an array has another shape, or a number exceeds its bits.
    """

    config: ClassifierConfig
    w_in: Whole  # shape (inputs, hidden)
    w_rec: Whole  # from the first index to the second, shape (hidden, hidden)
    w_out: Whole  # shape (hidden, classes)
    b_hidden: Whole  # shape (hidden,)
    b_out: Whole  # shape (classes,)

    def __post_init__(self) -> None:
        for name, (shape, bits) in _arrays(self.config).items():
            values = np.asarray(getattr(self, name))
            if values.shape != shape:
                raise InputError(f"{name} has the shape {values.shape}, but the network needs {shape}")
            if values.dtype.kind not in "iu":
                raise InputError(f"{name} must be integers, not {values.dtype}")
            if values.min() < lowest(bits) or values.max() > highest(bits):
                worst = max(values.min(), values.max(), key=abs)
                raise InputError(f"{name} must be in {lowest(bits)}..{highest(bits)}, {bits} bits, not {worst}")
            object.__setattr__(self, name, values.astype(np.int64))

    @classmethod
    def filled(cls, config: ClassifierConfig, fill: Callable[..., Whole]) -> IntegerNetwork:
        """Return a network whose arrays are made by a function of bit width and shape."""
        return cls(config, **{name: fill(bits, *shape) for name, (shape, bits) in _arrays(config).items()})

    @property
    def hidden_ends(self) -> tuple[int, int] | None:
        """Return the range of the hidden potentials for these weights, or None if unlimited."""
        config = self.config
        added = (
            config.events_per_bin * end.reduce(self.w_in << config.in_shift, axis=0, initial=0)
            + end(self.w_rec << config.rec_shift, 0).sum(0)
            + end(self.b_hidden << config.bias_shift, 0)
            for end in (np.minimum, np.maximum)
        )
        return _widest(config.hidden_ends, *added)

    @property
    def output_ends(self) -> tuple[int, int] | None:
        """Return the range of the output potentials for these weights, or None if unlimited."""
        config = self.config
        added = (
            end(self.w_out << config.out_shift, 0).sum(0) + end(self.b_out << config.out_bias_shift, 0)
            for end in (np.minimum, np.maximum)
        )
        return _widest(config.output_ends, *added)

    def sized(self) -> IntegerNetwork:
        """Return the network with the narrowest potentials that cannot saturate.

        A slightly larger width is used if it covers any weights, because the adders then need no saturation. If there
        is no such width, or it exceeds 32 bits, the widths do not change and potentials saturate.
        """
        changes = {}
        for name, own, any_weights in (
            ("membrane_bits", self.hidden_ends, self.config.hidden_range),
            ("output_bits", self.output_ends, self.config.output_range),
        ):
            bits, enough = bits_of(own), bits_of(any_weights)
            if (found := enough if enough <= bits + 1 else bits) <= MAX_BITS:
                changes[name] = max(int(found), 4)
        return dataclasses.replace(self, config=self.config.replace(**changes))

    def run_counts(self, counts: NDArray[Any]) -> tuple[Whole, float]:
        """Return the evidence after the last bin of several scans, and the mean spikes per bin and neuron.

        Events of a bin count in rising order of their channel. The order only matters if a potential saturates.
        ``counts`` has the shape (scans, bins, inputs), the evidence (scans, classes).
        """
        if counts.ndim != 3 or counts.shape[2] != self.config.inputs:
            raise InputError(
                f"the network has {self.config.inputs} input channels, but the scans have {counts.shape[-1]}"
            )
        state = State(self, len(counts))
        fired = 0
        for number in range(counts.shape[1]):
            state.add_counts(counts[:, number])
            state.end_bin()
            fired += int(state.spikes.sum())
        return state.evidence, fired / max(counts.shape[0] * counts.shape[1] * self.config.hidden, 1)


class State:
    """Potentials, spikes and evidence of several scans at one moment.

    The order of additions is part of the contract: leaked potential, bias, events as they are taken, recurrent spikes
    in rising order of their neuron. Each addition stops at the end of the bits. In neurons with a synaptic current all
    this adds to the current, and the end of the bin adds the current to the leaked potential.

    ``v``, shape (scans, hidden), are potentials or synaptic currents; with a current, ``rest`` are the potentials after
    the previous bin, leaked. ``spikes`` are those of the previous bin. ``output`` and ``output_rest``, shape (scans,
    classes), are like v and rest, and ``evidence`` has their shape.
    """

    def __init__(self, network: IntegerNetwork, scans: int = 1) -> None:
        config = network.config
        self.network, self.config = network, config
        self._in = network.w_in << config.in_shift
        self._rec = network.w_rec << config.rec_shift
        self._out = network.w_out << config.out_shift
        self._bias = network.b_hidden << config.bias_shift
        self._out_bias = network.b_out << config.out_bias_shift
        self.v = _sum(np.zeros((scans, config.hidden), np.int64), self._bias, config.membrane_bits)
        self.spikes, self.rest = np.zeros_like(self.v), np.zeros_like(self.v)
        self.output = _sum(np.zeros((scans, config.classes), np.int64), self._out_bias, config.output_bits)
        self.evidence, self.output_rest = np.zeros_like(self.output), np.zeros_like(self.output)

    def add_events(self, channels: Sequence[int]) -> None:
        """Add the input weights of each event of one scan to ``v``, in the order of the events."""
        sums = self.v + self._in[np.asarray(channels, np.int64)].cumsum(0)[:, None]
        bits = self.config.membrane_bits
        if sums.min(initial=0) >= lowest(bits) and sums.max(initial=0) <= highest(bits):
            self.v = sums[-1] if len(sums) else self.v
            return
        for channel in channels:
            self.v = _sum(self.v, self._in[channel], bits)

    def add_counts(self, counts: NDArray[Any]) -> None:
        """Add the event counts of a bin, shape (scans, inputs), in rising order of channels."""
        self.v = _add(self.v, counts, self._in, self.config.membrane_bits)

    def end_bin(self) -> tuple[Whole, Whole, Whole, Whole]:
        """End a bin: update neurons and evidence, then apply leak and bias.

        Returns potentials as compared and spikes of the hidden neurons, shape (scans, hidden), and of the outputs,
        shape (scans, classes).
        """
        config = self.config
        bits, out_bits, evidence_bits = config.membrane_bits, config.output_bits, config.evidence_bits
        leak, synapse = Leak(config.leak_shift, config.leak_factor), Leak(config.synapse_shift, config.synapse_factor)
        v = _add(self.v, self.spikes, self._rec, bits)
        potential = _sum(self.rest, v, bits) if synapse.shift else v
        potential, self.spikes, rest = _fire(potential, config.threshold, config.floor, config.neuron_reset)
        self.rest = _leak(rest, leak)
        self.v = _sum(_leak(v, synapse) if synapse.shift else self.rest, self._bias, bits)

        leak = Leak(config.out_leak_shift, config.out_leak_factor)
        synapse = Leak(config.out_synapse_shift, config.out_synapse_factor)
        v = _add(self.output, self.spikes, self._out, out_bits)
        output = _sum(self.output_rest, v, out_bits) if synapse.shift else v
        if config.readout == "spikes":
            output, fired, rest = _fire(output, config.out_threshold, config.out_floor, config.neuron_reset)
            gained = fired
        else:
            fired, rest, gained = np.zeros_like(output), output, output
        self.output_rest = _leak(rest, leak)
        self.output = _sum(_leak(v, synapse) if synapse.shift else self.output_rest, self._out_bias, out_bits)
        self.evidence = _sum(self.evidence, gained, evidence_bits)
        return potential, self.spikes, output, fired

    def end_single_bin(self) -> Bin:
        """End a bin of one scan."""
        potential, spikes, output, fired = (values[0] for values in self.end_bin())
        return Bin(potential, spikes, output, fired, self.evidence[0], int(self.evidence[0].argmax()))


def _sum(v: Whole, added: Whole, bits: int) -> Whole:
    """Return a sum that stops at the ends of its bits."""
    return np.clip(v + added, lowest(bits), highest(bits))


def _add(v: Whole, counts: NDArray[Any], weights: Whole, bits: int) -> Whole:
    """Add the weights of all events or spikes, shape (scans, sources), to v in rising order of their source."""
    size = np.abs(weights)
    most = min(counts.max(initial=0) * size.sum(0).max(), counts.sum(1).max(initial=0) * size.max())
    if np.abs(v).max(initial=0) + most <= highest(bits):  # nothing saturates: the product is exact, far below 2**53
        return v + (counts.astype(np.float64) @ weights.astype(np.float64)).astype(np.int64)
    for source in np.flatnonzero(counts.any(0)):
        # Equal additions stop at the same end of the bits as one addition of their sum.
        v = _sum(v, counts[:, source, None].astype(np.int64) * weights[source], bits)
    return v


def _fire(v: Whole, threshold: int, floor: int | None, reset: str) -> tuple[Whole, Whole, Whole]:
    """Return the clipped potentials, the spikes (0 or 1), and the potentials after reset."""
    if floor is not None:
        v = np.maximum(v, floor)
    fired = (v > threshold).astype(np.int64)
    return v, fired, v - fired * threshold if reset == "subtract" else v * (1 - fired)


def _leak(v: Whole, leak: Leak) -> Whole:
    """Return a potential after the leak of one bin, rounded down."""
    return v - (v * leak.factor >> leak.shift) if leak.shift else v


def _widest(of: Any, low: Whole, high: Whole) -> tuple[int, int] | None:
    """Return the range that covers all neurons if each bin adds between ``low`` and ``high``."""
    found = [of(int(a), int(b)) for a, b in zip(low, high, strict=True)]
    if None in found:
        return None
    return min(low for low, _ in found), max(high for _, high in found)
