"""Convert a trained network to integers for the hardware classifier (docs/reference/classifier.md)."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.model.classifier.config import MAX_OWN_SHIFT, ClassifierConfig, Leak, bits_of
from eskin.model.classifier.file import IntegerWeights
from eskin.model.classifier.network import IntegerNetwork
from eskin.snn.exchange.weights import Weights, config_of
from eskin.snn.network import SpikingNetwork
from eskin.snn.rounding import Grid, grid_of, related_grids

LARGEST_SHIFT = 16

DECAYS = {
    "decay": "leak",
    "output_decay": "out_leak",
    "synapse_decay": "synapse",
    "output_synapse_decay": "out_synapse",
}
"""Decays of a trained network, and the leaks of the hardware that they become."""

SYNAPTIC_DECAY_BITS = 8
"""Bits of the decays of networks with synaptic currents; these decays are seldom shifts."""


SAME_DECAY = 1e-6
"""Largest difference of decays that count as one."""

CLOCKS_HZ = (1e3, 1e10)
"""Clocks that hardware may have."""


@dataclass(frozen=True, kw_only=True)
class Precision:
    """Bit widths of an integer network, and the clock of its hardware."""

    in_bits: int = 8
    rec_bits: int = 8
    out_bits: int = 8
    bias_bits: int = 9
    decay_bits: int | None = None
    """A decay becomes the nearest multiple of 2**-decay_bits, which costs an adder for every 1 or two in it; None: the
    nearest 1 - 2**-k, which is a shift, or 8 bits in a network with synaptic currents."""
    threshold_bits: int = 8
    """The potential's unit is a weight of 1 divided by a power of two, such that the threshold has at least this many
    bits. The leak is rounded to this unit."""
    membrane_bits: int | None = None
    output_bits: int | None = None
    """Bits of the potentials; None for as many as they can ever need."""
    lanes: int = 16
    clock_hz: float = 50e6
    margin: int = 0
    """Evidence by which a class must exceed all others for an early decision; 0 for none."""
    narrow: bool = False
    """Without ``membrane_bits``: let hidden potentials saturate as in ``ClassifierConfig.narrow_bits``."""

    def __post_init__(self) -> None:
        most = {"threshold_bits": 16, "bias_bits": 16, "decay_bits": LARGEST_SHIFT}
        for name, high in (most | dict.fromkeys(("in_bits", "rec_bits", "out_bits"), 8)).items():
            value = getattr(self, name)
            if value is not None and not 2 <= value <= high:
                raise InputError(f"{name} must be in 2..{high}, not {value}")
        if not CLOCKS_HZ[0] <= self.clock_hz <= CLOCKS_HZ[1]:
            raise InputError(f"the clock must be in {CLOCKS_HZ[0]:g}..{CLOCKS_HZ[1]:g} hertz, not {self.clock_hz!r}")


@dataclass
class _Units:
    """Grids of several weight matrices, and the unit of the potential to which their products are added."""

    unit: float
    shifts: list[int]
    threshold: int
    bias: NDArray[np.int64]
    bias_shift: int


def quantise(weights: Weights, precision: Precision) -> IntegerWeights:
    """Return a trained network quantised to integers, with the rounding errors in its notes.

    The input scale is folded into the input weights. Every matrix uses the step with the smallest error, including
    clipping; the steps of input and recurrence differ by a power of two.

    Raise InputError if the network is none that the hardware has.
    """
    network = weights.network
    if not isinstance(network, SpikingNetwork):
        raise InputError(f"the hardware needs a spiking network, not kind {config_of(network).kind}")
    config = network.config
    arrays = {name: value.detach().cpu().double().numpy() for name, value in network.named_parameters()}
    _check(network, arrays)
    notes: dict[str, Any] = {}
    leaks, shifts = _leaks(network, precision, notes)
    w_in, w_rec, w_out = arrays["w_in"].T * config.input_scale, arrays["w_rec"].T, arrays["w_out"].T
    in_grid, rec_grid = related_grids((w_in, w_rec), (precision.in_bits, precision.rec_bits))
    out_grid = grid_of(w_out, precision.out_bits)
    hidden = _units([in_grid, rec_grid], arrays["b_hidden"], precision)
    outputs = _units([out_grid], arrays["b_out"], precision)
    grids = {"w_in": (in_grid, w_in), "w_rec": (rec_grid, w_rec), "w_out": (out_grid, w_out)}
    for name, (grid, matrix) in grids.items():
        notes[name] = {"step": grid.step, "error": grid.error(matrix)}
    notes["unit"], notes["output_unit"] = hidden.unit, outputs.unit

    fields: dict[str, Any] = {
        "inputs": config.inputs,
        "hidden": config.hidden,
        "classes": config.classes,
        "lanes": precision.lanes,
        "clocks_per_bin": max(round(precision.clock_hz * weights.step_s), 1),
        "bin_s": weights.step_s,
        **{name: getattr(precision, name) for name in ("in_bits", "rec_bits", "out_bits", "bias_bits")},
        "in_shift": hidden.shifts[0],
        "rec_shift": hidden.shifts[1],
        "bias_shift": hidden.bias_shift,
        "out_shift": outputs.shifts[0],
        "out_bias_shift": outputs.bias_shift,
        "threshold": hidden.threshold,
        "floor": _floor(config.floor, hidden.unit),
        "layers": _groups(config.layers, w_rec),
        "neuron_reset": config.reset,
        **leaks,
        "readout": config.readout,
        "out_threshold": outputs.threshold,
        "out_floor": _floor(config.floor, outputs.unit),
        "membrane_bits": 32,
        "output_bits": 32,
    }
    whole = {name: grid.whole(matrix) for name, (grid, matrix) in grids.items()}
    biases = {"b_hidden": hidden.bias, "b_out": outputs.bias}
    made = IntegerNetwork(ClassifierConfig.from_dict(fields), **whole, **biases, **shifts).sized()
    return IntegerWeights(_with_widths(made, precision), weights.class_names, notes)


def _groups(sizes: tuple[int, ...], w_rec: NDArray[np.float64]) -> list[tuple[int, int, list[int]]]:
    """Return start, end and groups read of each layer of a stack; a layer without recurrent weights skips itself."""
    ends = np.cumsum(sizes).tolist()
    found = []
    for number, (size, end) in enumerate(zip(sizes, ends, strict=True)):
        own = [number] if w_rec[end - size : end, end - size : end].any() else []
        found.append((end - size, end, [number - 1] * bool(number) + own))
    return found


def _with_widths(made: IntegerNetwork, precision: Precision) -> IntegerNetwork:
    """Return a network with the requested bit widths, and evidence wide enough for a thousand bins."""
    changes: dict[str, Any] = {
        name: getattr(precision, name)
        for name in ("membrane_bits", "output_bits")
        if getattr(precision, name) is not None
    }
    config = made.config
    if precision.membrane_bits is None and precision.narrow:
        changes["membrane_bits"] = config.narrow_bits
    per_bin = int(min(bits_of(made.output_ends), 22)) if made.config.readout == "membrane" else 1
    config = config.replace(**changes, evidence_bits=per_bin + 10, margin=precision.margin)
    return replace(made, config=config)


def _check(network: SpikingNetwork, arrays: dict[str, NDArray[np.float64]]) -> None:
    for name, values in arrays.items():
        if not np.isfinite(values).all():
            raise InputError(f"{name} has values that are not finite; train again")
    floor = network.config.floor
    if floor > 0:
        raise InputError(f"the hardware needs a floor of at most 0, but the network has {floor:g}")


def _leaks(
    network: SpikingNetwork, precision: Precision, notes: dict[str, Any]
) -> tuple[dict[str, Any], dict[str, NDArray[np.int64]]]:
    """Return the leak fields of the hardware, and the leak shift of each neuron if decays differ; add their notes."""
    config = network.config
    decays = [values.detach().cpu().double().numpy() for values in network.decays()]
    synapses = [np.array([value]) for value in (config.synapse_decay, config.output_synapse_decay)]
    decay_bits = SYNAPTIC_DECAY_BITS if precision.decay_bits is None and any(synapses) else precision.decay_bits
    own = any(np.ptp(values) > SAME_DECAY for values in decays)
    if own and precision.decay_bits is not None:
        raise InputError("decays of each neuron become shifts; leave --decay-bits out")
    leaks: dict[str, Any] = {"own_parameters": own}
    shifts: dict[str, NDArray[np.int64]] = {}
    for (name, place), values in zip(DECAYS.items(), [*decays, *synapses], strict=True):
        if "synapse" in name and not values[0]:
            continue
        if own and "synapse" not in name:
            shifts[place], notes[name] = _own_leaks(values)
            continue
        leak, notes[name] = _leak(float(values.mean()), decay_bits)
        leaks |= {f"{place}_shift": leak.shift, f"{place}_factor": leak.factor}
    return leaks, shifts


def _leak(decay: float, bits: int | None) -> tuple[Leak, dict[str, float]]:
    """Return the hardware leak closest to the common decay of all neurons, with both decays."""
    if bits is None:
        leak = Leak(int(_shifts(np.array([decay]), LARGEST_SHIFT)[0]))
    else:
        lost = max(round((1 - decay) * 2**bits), int(decay < 1))
        common = min((lost & -lost).bit_length() - 1, bits - 1) if lost else bits
        leak = Leak(bits - common, max(lost >> common, 1))
    return leak, {"trained": decay, "hardware": 1 - leak.factor * 2.0**-leak.shift if leak.shift else 1.0}


def _own_leaks(decays: NDArray[np.float64]) -> tuple[NDArray[np.int64], dict[str, Any]]:
    """Return the leak shift of each neuron, with the ends of both decays and the mean error."""
    shifts = _shifts(decays, MAX_OWN_SHIFT)
    hardware = _decays(shifts)
    ends = {
        name: [float(values.min()), float(values.max())]
        for name, values in (("trained", decays), ("hardware", hardware))
    }
    return shifts, ends | {"error": float(np.abs(hardware - decays).mean())}


def _shifts(decays: NDArray[np.float64], most: int) -> NDArray[np.int64]:
    """Return the leak shifts, 0 to ``most``, with the nearest decays."""
    return np.abs(_decays(np.arange(most + 1)) - decays[:, None]).argmin(1)


def _decays(shifts: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the decays of leak shifts; a shift of 0 means no leak."""
    return np.where(shifts, 1 - 2.0**-shifts, 1.0)


def _units(grids: list[Grid], bias: NDArray[np.float64], precision: Precision) -> _Units:
    """Return the unit of a potential, fine enough to give the threshold its requested bits."""
    smallest = min(grid.step for grid in grids)
    wanted = 2.0 ** (precision.threshold_bits - 1)
    finer = max(math.ceil(math.log2(wanted * smallest)), 0)
    unit = smallest / 2.0**finer
    shifts = [round(math.log2(grid.step / unit)) for grid in grids]
    if max(shifts) > LARGEST_SHIFT:
        raise InputError(
            f"the weights of the layers differ too much in scale for a shift of at most {LARGEST_SHIFT}; "
            f"give fewer threshold bits"
        )
    threshold = max(round(1 / unit), 1)
    if threshold >= 2**30:
        raise InputError(f"the weights are so small that the threshold is {threshold} weight steps; train again")
    largest = (1 << precision.bias_bits - 1) - 1
    top = float(np.abs(bias).max()) / unit
    bias_shift = min(max(math.ceil(math.log2(top / largest)), 0) if top > largest else 0, LARGEST_SHIFT)
    return _Units(unit, shifts, threshold, Grid(unit * 2.0**bias_shift, largest).whole(bias), bias_shift)


def _floor(floor: float, unit: float) -> int | None:
    return None if math.isinf(floor) else max(round(floor / unit), -(2**31))


def summary(made: IntegerWeights) -> list[str]:
    """Return the changes made by quantisation as sentences."""
    config, notes = made.network.config, made.notes
    lines = [
        f"{config.inputs} inputs, {config.hidden} hidden neurons, {config.classes} classes: "
        f"{config.memory_bits / 8000:.1f} kB of memory"
    ]
    for name, bits in (("w_in", config.in_bits), ("w_rec", config.rec_bits), ("w_out", config.out_bits)):
        lines.append(
            f"{name}: {bits} bits, a 1 is {notes[name]['step']:.4g}, rounding changes {notes[name]['error']:.1%}"
        )
    for name, place in DECAYS.items():
        if "error" in notes.get(name, {}):
            (low, high), error = notes[name]["trained"], notes[name]["error"]
            lines.append(
                f"{name} of {low:.3g} to {high:.3g} becomes a shift for each neuron, {error:.3g} off on average"
            )
            continue
        trained, hardware = (notes[name][kind] if name in notes else 0.0 for kind in ("trained", "hardware"))
        if abs(trained - hardware) > 1e-6:
            means = "with a shift" if getattr(config, f"{place}_factor") == 1 else "in the decay's bits"
            lines.append(f"{name} of {trained:.4g} becomes {hardware:.4g}, the nearest value {means}")
    enough = bits_of(made.network.hidden_ends)
    saturates = f"which saturate ({enough} bits would cover all values)" if enough < math.inf else "which saturate"
    if enough <= config.membrane_bits:
        saturates = "which cover all values"
    lines.append(f"threshold {config.threshold}, potentials of {config.membrane_bits} bits, {saturates}")
    return lines
