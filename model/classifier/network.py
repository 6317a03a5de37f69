"""Model of the integer network, bit-exact in every bin (docs/reference/classifier.md).

This is the golden model of ``rtl/classifier``, without lanes and words.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.model.classifier.config import (
    MAX_BITS,
    MAX_OWN_SHIFT,
    ClassifierConfig,
    Leak,
    bits_of,
    highest,
    largest_threshold,
    lowest,
)

Whole = NDArray[np.int64]

COMMON: Whole = np.zeros(0, np.int64)
"""Placeholder for parameters of neurons that are those of the configuration."""


class Bin(NamedTuple):
    """Potentials, spikes (0 or 1) and evidence at the end of a bin."""

    potential: Whole  # as compared with the threshold, shape (hidden,)
    spikes: Whole  # shape (hidden,)
    output: Whole  # shape (classes,)
    output_spikes: Whole  # shape (classes,); membrane outputs never spike
    evidence: Whole  # since the scan began, shape (classes,)
    winner: int  # the class: the first output with the most evidence
    sure: bool  # an early decision: the evidence has exceeded all others by the margin in this or an earlier bin


def _arrays(config: ClassifierConfig) -> dict[str, tuple[tuple[int, ...], int]]:
    """Return the shape and the bit width of every weight array of a network."""
    return {
        "w_in": ((config.inputs, config.hidden), config.in_bits),
        "w_rec": ((config.hidden, config.hidden), config.rec_bits),
        "w_out": ((config.hidden, config.classes), config.out_bits),
        "b_hidden": ((config.hidden,), config.bias_bits),
        "b_out": ((config.classes,), config.bias_bits),
    }


def _connected(config: ClassifierConfig) -> dict[str, NDArray[np.bool_]]:
    """Return for every matrix of a network which of its weights exist."""
    stack, neuron = config.stack, np.arange(config.hidden)
    group = group_of(config)
    reads = np.array([[source in reader.reads for reader in stack] for source in range(len(stack))])
    return {
        "w_in": np.broadcast_to(group == 0, (config.inputs, config.hidden)),
        "w_rec": reads[group][:, group],
        "w_out": np.broadcast_to(neuron[:, None] >= stack[-1].start, (config.hidden, config.classes)),
    }


def group_of(config: ClassifierConfig) -> Whole:
    """Return the number of the group of every hidden neuron."""
    return np.repeat(np.arange(len(config.stack)), [group.end - group.start for group in config.stack])


def _parameters(config: ClassifierConfig) -> dict[str, tuple[int, int, int, int]]:
    """Return the size, the common value, the least and the largest value of every array of neuron parameters."""
    hidden, classes = config.hidden, config.classes
    found = {
        "threshold": (hidden, config.threshold, 1, largest_threshold(config.threshold)),
        "leak": (hidden, config.leak_shift, 0, MAX_OWN_SHIFT),
        "out_threshold": (classes, config.out_threshold, 1, largest_threshold(config.out_threshold)),
        "out_leak": (classes, config.out_leak_shift, 0, MAX_OWN_SHIFT),
    }
    if config.own_parameters:
        return found
    return {name: (size, common, common, common) for name, (size, common, _, _) in found.items()}


@dataclass(frozen=True, eq=False)
class IntegerNetwork:
    """A spiking network with integer weights.

    Raises InputError if an array has another shape, or a number exceeds its bits. Thresholds and leak shifts may
    differ from those of the configuration only in a network with own parameters.
    """

    config: ClassifierConfig
    w_in: Whole  # shape (inputs, hidden)
    w_rec: Whole  # from the first index to the second, shape (hidden, hidden)
    w_out: Whole  # shape (hidden, classes)
    b_hidden: Whole  # shape (hidden,)
    b_out: Whole  # shape (classes,)
    # thresholds and leak shifts, shapes (hidden,) and (classes,); by default those of the configuration
    threshold: Whole = field(default_factory=lambda: COMMON)
    leak: Whole = field(default_factory=lambda: COMMON)
    out_threshold: Whole = field(default_factory=lambda: COMMON)
    out_leak: Whole = field(default_factory=lambda: COMMON)

    def __post_init__(self) -> None:
        for name, (shape, bits) in _arrays(self.config).items():
            self._check(name, shape, lowest(bits), highest(bits), f", {bits} bits")
        for name, (size, common, least, most) in _parameters(self.config).items():
            if getattr(self, name) is COMMON:
                object.__setattr__(self, name, np.full(size, common))
            self._check(name, (size,), least, most, "" if self.config.own_parameters else " without own parameters")
        for name, connected in _connected(self.config).items() if self.config.layers else ():
            if getattr(self, name)[~connected].any():
                raise InputError(f"{name} has a weight between groups that are not connected")

    def _check(self, name: str, shape: tuple[int, ...], least: int, most: int, why: str) -> None:
        """Check an array and store it as 64-bit integers."""
        values = np.asarray(getattr(self, name))
        if values.shape != shape:
            raise InputError(f"{name} has the shape {values.shape}, but the network needs {shape}")
        if values.dtype.kind not in "iu":
            raise InputError(f"{name} must be integers, not {values.dtype}")
        if values.min() < least or values.max() > most:
            worst = max(values.min(), values.max(), key=abs)
            raise InputError(f"{name} must be in {least}..{most}{why}, not {worst}")
        object.__setattr__(self, name, values.astype(np.int64))

    @classmethod
    def filled(cls, config: ClassifierConfig, fill: Callable[..., Whole]) -> IntegerNetwork:
        """Return a network whose arrays are made by a function of bit width and shape."""
        arrays = {name: fill(bits, *shape) for name, (shape, bits) in _arrays(config).items()}
        arrays |= {name: arrays[name] * connected for name, connected in _connected(config).items()}
        for name, (size, _, least, most) in _parameters(config).items() if config.own_parameters else ():
            arrays[name] = np.clip(np.abs(fill(most.bit_length() + 1, size)), least, most)
        return cls(config, **arrays)

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
        return _widest(config.hidden_ends, *added, self.threshold, self.leak)

    @property
    def output_ends(self) -> tuple[int, int] | None:
        """Return the range of the output potentials for these weights, or None if unlimited."""
        config = self.config
        added = (
            end(self.w_out << config.out_shift, 0).sum(0) + end(self.b_out << config.out_bias_shift, 0)
            for end in (np.minimum, np.maximum)
        )
        return _widest(config.output_ends, *added, self.out_threshold, self.out_leak)

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
        """Return the evidence of all bins of several scans, and the mean spikes per bin and neuron; see ``run_bins``.

        ``counts`` has the shape (scans, bins, inputs), the evidence (scans, classes).
        """
        state, fired, bins = State(self, len(counts)), 0, 0
        for state in self.run_bins(counts):
            fired, bins = fired + int(state.spikes.sum()), bins + 1
        return state.evidence, fired / max(len(counts) * bins * self.config.hidden, 1)

    def run_bins(self, counts: NDArray[Any]) -> Iterator[State]:
        """Yield the state of several scans after each bin; ``counts`` has the shape (scans, bins, inputs).

        A stack computes ``delay_bins`` more bins without events, until its outputs have counted the last bin. Events of
        a bin count in rising order of their channel. The order only matters if a potential saturates.
        """
        if counts.ndim != 3 or counts.shape[2] != self.config.inputs:
            raise InputError(
                f"the network has {self.config.inputs} input channels, but the scans have {counts.shape[-1]}"
            )
        later = np.zeros((len(counts), self.config.delay_bins, counts.shape[2]), counts.dtype)
        state = State(self, len(counts))
        for of_bin in np.concatenate([counts, later], 1).swapaxes(0, 1):
            state.add_counts(of_bin)
            state.end_bin()
            yield state


class State:
    """Potentials, spikes and evidence of several scans at one moment.

    The order of additions is part of the contract: leaked potential, bias, events as they are taken, recurrent spikes
    in rising order of their neuron. Each addition stops at the end of the bits. In neurons with a synaptic current all
    this adds to the current, and the end of the bin adds the current to the leaked potential.

    ``v``, shape (scans, hidden), are potentials or synaptic currents; with a current, ``rest`` are the potentials after
    the previous bin, leaked. ``spikes`` are those of the previous bin. ``output`` and ``output_rest``, shape (scans,
    classes), are like v and rest, and ``evidence`` has their shape. ``sure``, shape (scans,), is true from the early
    decision of a scan on.

    In a stack, group k rests for k bins, and the outputs for ``delay_bins``: until the first bin has come through the
    groups before them.
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
        self.sure = np.zeros(scans, np.bool_)
        self._group, self._ended = group_of(config), 0

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
        config, network = self.config, self.network
        bits, out_bits, evidence_bits = config.membrane_bits, config.output_bits, config.evidence_bits
        synapse = Leak(config.synapse_shift, config.synapse_factor)
        v = np.where(self._group > self._ended, 0, _add(self.v, self.spikes, self._rec, bits))
        potential = _sum(self.rest, v, bits) if synapse.shift else v
        potential, self.spikes = _fire(potential, network.threshold, config.floor)
        leak = network.leak, config.leak_factor
        self.rest = _rest(potential, self.spikes, network.threshold, config.neuron_reset, *leak)
        self.v = _sum(_leak(v, *synapse) if synapse.shift else self.rest, self._bias, bits)

        synapse = Leak(config.out_synapse_shift, config.out_synapse_factor)
        v = _add(self.output, self.spikes, self._out, out_bits)
        if self._ended < config.delay_bins:
            v = np.zeros_like(v)
        self._ended += 1
        output = _sum(self.output_rest, v, out_bits) if synapse.shift else v
        if config.readout == "spikes":
            output, fired = _fire(output, network.out_threshold, config.out_floor)
            gained = fired
        else:
            fired, gained = np.zeros_like(output), output
        leak = network.out_leak, config.out_leak_factor
        self.output_rest = _rest(output, fired, network.out_threshold, config.neuron_reset, *leak)
        self.output = _sum(_leak(v, *synapse) if synapse.shift else self.output_rest, self._out_bias, out_bits)
        self.evidence = _sum(self.evidence, gained, evidence_bits)
        if config.margin:
            self.sure |= lead(self.evidence) >= config.margin
        return potential, self.spikes, output, fired

    def end_single_bin(self) -> Bin:
        """End a bin of one scan."""
        potential, spikes, output, fired = (values[0] for values in self.end_bin())
        evidence = self.evidence[0]
        return Bin(potential, spikes, output, fired, evidence, int(evidence.argmax()), bool(self.sure[0]))


def lead(evidence: Whole) -> Whole:
    """Return how far the most evidence exceeds all others; shapes (..., classes), at least 2, and (...)."""
    second, first = np.moveaxis(np.partition(evidence, -2, -1)[..., -2:], -1, 0)
    return first - second


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


def _fire(v: Whole, threshold: Whole, floor: int | None) -> tuple[Whole, Whole]:
    """Return the clipped potentials, and the spikes (0 or 1)."""
    if floor is not None:
        v = np.maximum(v, floor)
    return v, (v > threshold).astype(np.int64)


def _rest(v: Whole, fired: Whole, threshold: Whole, reset: str, shift: Whole, factor: int) -> Whole:
    """Return potentials after reset and leak."""
    if reset == "delayed":
        return _leak(v, shift, factor) - fired * threshold
    return _leak(v - fired * threshold if reset == "subtract" else v * (1 - fired), shift, factor)


def _leak(v: Whole, shift: Whole | int, factor: int) -> Whole:
    """Return potentials after the leak of one bin, rounded down; a shift of 0 means no leak."""
    return v - np.where(shift, v * factor >> shift, 0)


def _widest(of: Any, *neurons: Whole) -> tuple[int, int] | None:
    """Return the range that covers all neurons: the least and most that a bin adds, thresholds and leak shifts."""
    found = [of(*map(int, neuron)) for neuron in zip(*neurons, strict=True)]
    if None in found:
        return None
    return min(low for low, _ in found), max(high for _, high in found)
