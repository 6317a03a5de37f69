"""Configuration of the hardware classifier (docs/reference/classifier.md)."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

from eskin.base.configuration import Configuration, parameter
from eskin.base.errors import InputError
from eskin.model.config import Reset

NeuronReset = Literal["zero", "subtract", "delayed"]
OutputMode = Literal["spikes", "membrane"]

MAX_INPUTS = 2 * 64 * 64
MAX_HIDDEN = 4096
MAX_CLASSES = 64
MAX_BITS = 32
"""Largest number of bits of a potential."""

OWN_SHIFT_BITS = 3
MAX_OWN_SHIFT = 2**OWN_SHIFT_BITS - 1
"""Largest leak shift of a neuron with own parameters; 0 means no leak."""

HEADROOM = 32
"""Thresholds, or floors if these are larger, on each side of 0 before a narrow potential saturates. With 16 of them no
class of 24 trained networks changed."""

CLASSIFIER = "docs/reference/classifier.md"


class Group(NamedTuple):
    """Consecutive hidden neurons with equal connections, such as a layer of a stack."""

    start: int
    end: int
    """First neuron, and the neuron behind the last."""
    reads: tuple[int, ...]
    """Numbers of the groups whose spikes it gets, one bin later."""


class Span(NamedTuple):
    """Words of potentials: the first of them, and how many there are."""

    first: int
    words: int


@dataclass(frozen=True, kw_only=True)
class ClassifierConfig(Configuration):
    """All parameters of an integer network except its weights; immutable and validated.

    Hidden and output potentials have their own units; a weight counts ``2**shift`` of them. A potential saturates at
    the limits of its bits. If ``saturates`` is false, no potential can reach the limits. ``parameter`` describes each
    field; neurons with a leak or a synaptic current need more words:

    - A hidden neuron spikes if v > threshold. After a bin v - (v * leak_factor >> leak_shift) remains.
    - Neurons with a synaptic current (NIR: CubaLIF) add weights and bias to the current i. At the end of a bin i is
      added to v; then i - (i * synapse_factor >> synapse_shift) remains. Shift 0: weights add to v.
    - Outputs fire, and their spikes are the evidence; or they do not fire, and the sum of their potentials is it. The
      fields ``out_...`` are those of the output neurons.
    - With ``own_parameters`` each neuron has a threshold and a leak of its own, which the host loads with the bias. A
      threshold has then at most as many bits as ``threshold``. ``threshold`` and ``leak_shift`` are the values of a
      network that states no others.
    """

    noun = ("a classifier's configuration", "classifier")

    inputs: int = parameter(
        128, "", CLASSIFIER, "channels: number of taxels, or twice as many with separate ON and OFF"
    )
    hidden: int = parameter(256, "", CLASSIFIER, "recurrent neurons")
    layers: tuple[Group, ...] = parameter(
        (), "", CLASSIFIER, "groups of neurons: start, end, groups that it reads [one group that reads itself]"
    )
    classes: int = parameter(6, "", CLASSIFIER, "output neurons")
    lanes: int = parameter(16, "", CLASSIFIER, "weights added in one clock, a power of two")
    clocks_per_bin: int = parameter(200_000, "", CLASSIFIER, "largest number of clocks in a time bin")
    bin_s: float = parameter(0.004, "s", CLASSIFIER, "time bin")
    in_bits: int = parameter(8, "", CLASSIFIER, "bits of an input weight, 2..8")
    rec_bits: int = parameter(8, "", CLASSIFIER, "bits of a recurrent weight, 2..8")
    out_bits: int = parameter(8, "", CLASSIFIER, "bits of an output weight, 2..8")
    bias_bits: int = parameter(9, "", CLASSIFIER, "bits of a bias, 2..16")
    in_shift: int = parameter(0, "", CLASSIFIER, "left shift of input weights")
    rec_shift: int = parameter(0, "", CLASSIFIER, "left shift of recurrent weights")
    bias_shift: int = parameter(0, "", CLASSIFIER, "left shift of biases")
    out_shift: int = parameter(0, "", CLASSIFIER, "left shift of output weights")
    out_bias_shift: int = parameter(0, "", CLASSIFIER, "left shift of output biases")
    membrane_bits: int = parameter(24, "", CLASSIFIER, "bits of a hidden potential")
    output_bits: int = parameter(20, "", CLASSIFIER, "bits of an output potential")
    evidence_bits: int = parameter(24, "", CLASSIFIER, "bits of the evidence for a class")
    threshold: int = parameter(256, "", CLASSIFIER, "threshold of the hidden neurons")
    floor: int | None = parameter(None, "", CLASSIFIER, "lower limit of a hidden potential [no floor]")
    neuron_reset: NeuronReset = parameter(
        "zero",
        "",
        CLASSIFIER,
        "a spike sets the potential to zero, or subtracts the threshold before or after the leak: "
        "zero, subtract, delayed",
    )
    leak_shift: int = parameter(0, "", CLASSIFIER, "leak per bin: v - (v * factor >> shift); 0: no leak")
    leak_factor: int = parameter(1, "", CLASSIFIER, "factor of the leak, up to 2**shift")
    synapse_shift: int = parameter(
        0, "", CLASSIFIER, "leak per bin of the synaptic current, as of the potential; 0: no synaptic current"
    )
    synapse_factor: int = parameter(1, "", CLASSIFIER, "factor of the leak of the synaptic current")
    readout: OutputMode = parameter(
        "spikes", "", CLASSIFIER, "evidence: spikes of the outputs, or membrane, the sum of their potentials"
    )
    out_threshold: int = parameter(
        256, "", CLASSIFIER, "readout spikes: threshold of the outputs; ignored with membrane"
    )
    out_floor: int | None = parameter(
        None, "", CLASSIFIER, "readout spikes: lower limit of an output potential [no floor]; ignored with membrane"
    )
    out_leak_shift: int = parameter(0, "", CLASSIFIER, "leak of the outputs")
    out_leak_factor: int = parameter(1, "", CLASSIFIER, "factor of the leak of the outputs")
    out_synapse_shift: int = parameter(
        0, "", CLASSIFIER, "leak of the synaptic current of the outputs; 0: no synaptic current"
    )
    out_synapse_factor: int = parameter(1, "", CLASSIFIER, "factor of the leak of the synaptic current of the outputs")
    own_parameters: bool = parameter(
        False, "", CLASSIFIER, "each neuron has a threshold and a leak of its own, loaded at run time"
    )
    margin: int = parameter(
        0, "", CLASSIFIER, "evidence by which a class must exceed all others for an early decision; 0: no class_sure"
    )
    reset: Reset = parameter("sync", "", CLASSIFIER, "reset style of the flops")

    def __post_init__(self) -> None:
        self._check_types(but=("layers",))
        object.__setattr__(self, "layers", self._groups_of(self.layers))
        ranges = {"inputs": (1, MAX_INPUTS), "hidden": (1, MAX_HIDDEN), "classes": (1, MAX_CLASSES)}
        ranges |= {"lanes": (1, 64), "clocks_per_bin": (1, 2**30), "bias_bits": (2, 16)}
        ranges |= dict.fromkeys(("in_bits", "rec_bits", "out_bits"), (2, 8))
        ranges |= dict.fromkeys(("membrane_bits", "output_bits", "evidence_bits"), (4, MAX_BITS))
        ranges |= dict.fromkeys(SHIFTS, (0, 16)) | {"margin": (0, 2**MAX_BITS - 1)}
        for name, (low, high) in ranges.items():
            self._check_range(name, low, high)
        for name in LEAKS:
            factor, most = getattr(self, f"{name}_factor"), 2 ** getattr(self, f"{name}_shift")
            if not 1 <= factor <= most:
                raise InputError(f"{name}_factor must be in 1..{most} (2**{name}_shift), not {factor}")
        if self.neuron_reset == "delayed" and (self.synapse_shift or self.out_synapse_shift):
            raise InputError("a delayed reset needs neurons without a synaptic current")
        for name in ("leak", "out_leak") if self.own_parameters else ():
            shift, factor = getattr(self, f"{name}_shift"), getattr(self, f"{name}_factor")
            if shift > MAX_OWN_SHIFT or factor > 1:
                raise InputError(
                    f"with own parameters, {name} must be a shift of at most {MAX_OWN_SHIFT}, not {factor} / 2**{shift}"
                )
        if self.margin >= 2**self.evidence_bits:
            raise InputError(
                f"margin must be below 2**{self.evidence_bits}, the range of the evidence, not {self.margin}"
            )
        if self.margin and self.classes < 2:
            raise InputError("an early decision needs two classes; leave margin out")
        if self.lanes & (self.lanes - 1):
            raise InputError(f"lanes must be a power of two, not {self.lanes}")
        if not (math.isfinite(self.bin_s) and self.bin_s > 0):
            raise InputError(f"bin_s must be a positive number of seconds, not {self.bin_s!r}")
        for threshold, floor, bits in (
            ("threshold", "floor", "membrane_bits"),
            ("out_threshold", "out_floor", "output_bits"),
        ):
            most = 2 ** (getattr(self, bits) - 1) - 1
            if not 1 <= getattr(self, threshold) <= most:
                raise InputError(
                    f"{threshold} must be in 1..{most} ({bits} {getattr(self, bits)}), not {getattr(self, threshold)}"
                )
            if getattr(self, floor) is not None and not -most - 1 <= getattr(self, floor) <= 0:
                raise InputError(f"{floor} must be in {-most - 1}..0 or none, not {getattr(self, floor)}")

    def _groups_of(self, given: Any) -> tuple[Group, ...]:
        """Return checked groups, or none for one group that reads itself."""
        try:
            found = tuple(Group(int(start), int(end), tuple(map(int, reads))) for start, end, reads in given)
        except (TypeError, ValueError):
            raise InputError(f"layers must list start, end and groups read of each group, not {given!r}") from None
        at = 0
        for number, group in enumerate(found):
            if group.start != at or group.end <= at:
                raise InputError(f"group {number} must start at {at} and end behind it, not at {group[:2]}")
            at = group.end
            if list(group.reads) != sorted(set(group.reads) & set(range(len(found)))):
                raise InputError(f"group {number} must read groups of 0..{len(found) - 1}, rising, not {group.reads}")
            if number and number - 1 not in group.reads:
                raise InputError(f"group {number} must read group {number - 1}, not only {group.reads}")
        if found and at != self.hidden:
            raise InputError(f"the groups end at {at}, but the network has {self.hidden} hidden neurons")
        if len(found) == 1 and not found[0].reads:
            raise InputError("a network of one group reads itself; leave its layers out")
        for number in range(len(found)):
            readers = [other for other, group in enumerate(found) if number in group.reads]
            if readers and len(readers) <= readers[-1] - readers[0]:
                raise InputError(f"the groups that read group {number} must be neighbours, not {readers}")
        return found if len(found) > 1 else ()

    # -- derived numbers -------------------------------------------------------------------------

    @property
    def stack(self) -> tuple[Group, ...]:
        """All groups of hidden neurons; the first gets the events, and the outputs read the last."""
        return self.layers or (Group(0, self.hidden, (0,)),)

    @property
    def delay_bins(self) -> int:
        """Bins from the end of a bin to the class that counts its events."""
        return len(self.stack) - 1

    @property
    def spans(self) -> tuple[Span, ...]:
        """Words of potentials that a spike of each group changes."""
        found = []
        for number in range(len(self.stack)):
            readers = [group for group in self.stack if number in group.reads]
            first = readers[0].start // self.lanes if readers else 0
            found.append(Span(first, -(-readers[-1].end // self.lanes) - first if readers else 0))
        return tuple(found)

    @property
    def groups(self) -> int:
        """Memory words per row of input weights, equal to the clocks per event."""
        return -(-self.stack[0].end // self.lanes)

    @property
    def lane_words(self) -> int:
        """Potentials in each lane."""
        return -(-self.hidden // self.lanes)

    @property
    def lane_bits(self) -> int:
        """Bits of the number of a potential in a lane."""
        return (self.lane_words - 1).bit_length()

    @property
    def weight_bits(self) -> int:
        """Bits of a weight in a word that the host loads."""
        return max(self.in_bits, self.rec_bits)

    @property
    def row_bits(self) -> int:
        """Bits of the word address within a row of input weights."""
        return (self.groups - 1).bit_length()

    @property
    def recurrent_words(self) -> int:
        """Words of the recurrent weights: a power of two for each hidden neuron; in a stack as many as it changes."""
        if self.layers:
            return sum(
                (group.end - group.start) * span.words for group, span in zip(self.stack, self.spans, strict=True)
            )
        return self.hidden << self.row_bits

    @property
    def input_words(self) -> int:
        """Words of the input weights: a power of two for each input."""
        return self.inputs << self.row_bits

    @property
    def weight_words(self) -> int:
        """Words of the recurrent weights, followed by the words of the input weights."""
        return self.recurrent_words + self.input_words

    @property
    def neuron_row_bits(self) -> int:
        """Bits of the word address within the row of a neuron."""
        return (self.classes + 1).bit_length()

    @property
    def neuron_words(self) -> int:
        """Words of the memory that holds output weights and biases."""
        return max(self.hidden, self.classes) << self.neuron_row_bits

    @property
    def neuron_weight_bits(self) -> int:
        """Bits per word of the memory that holds output weights and biases."""
        return max(self.out_bits, self.bias_bits)

    @property
    def threshold_bits(self) -> int:
        """Bits of the threshold of a neuron with own parameters."""
        return max(self.threshold, self.out_threshold).bit_length()

    @property
    def parameter_bits(self) -> int:
        """Bits of threshold and leak of a neuron with own parameters; 0 without them."""
        return self.threshold_bits + OWN_SHIFT_BITS if self.own_parameters else 0

    @property
    def parameter_words(self) -> int:
        """Words of the memory that holds thresholds and leaks: one for a hidden neuron, and one for an output."""
        return 2 * max(self.hidden, self.classes) if self.own_parameters else 0

    @property
    def neuron_bits(self) -> int:
        """Bits of a word of a neuron that the host loads: weight or bias, then threshold and leak."""
        return self.neuron_weight_bits + self.parameter_bits

    @property
    def memory_bits(self) -> int:
        """Total bits of the memories that the host loads."""
        rows = self.recurrent_words * self.rec_bits + self.input_words * self.in_bits
        neurons = self.neuron_words * self.neuron_weight_bits + self.parameter_words * self.parameter_bits
        return rows * self.lanes + neurons

    def additions(self, events: float, spikes: float, bins: float) -> float:
        """Return the number of additions of weights and biases for a number of events, hidden spikes and bins."""
        neurons = self.hidden + self.classes
        return events * self.stack[0].end + (spikes + bins) * neurons

    @property
    def channel_bits(self) -> int:
        """Bits of the channel number of an event; 0 for one input."""
        return (self.inputs - 1).bit_length()

    @property
    def class_bits(self) -> int:
        """Bits of the class number; 1 for one class."""
        return max((self.classes - 1).bit_length(), 1)

    @property
    def events_per_bin(self) -> int:
        """Largest number of events that the classifier accepts in a bin."""
        return -(-self.clocks_per_bin // self.groups)

    @property
    def clock_hz(self) -> float:
        """Clock frequency in hertz."""
        return self.clocks_per_bin / self.bin_s

    @property
    def hidden_range(self) -> tuple[int, int] | None:
        """Range of the hidden potentials over all possible weights and own parameters, or None if unlimited."""
        low = self.events_per_bin * lowest(self.in_bits, self.in_shift)
        low += self.hidden * lowest(self.rec_bits, self.rec_shift) + lowest(self.bias_bits, self.bias_shift)
        high = self.events_per_bin * highest(self.in_bits, self.in_shift)
        high += self.hidden * highest(self.rec_bits, self.rec_shift) + highest(self.bias_bits, self.bias_shift)
        return self._range(self.hidden_ends, low, high, self.threshold, self.leak_shift)

    @property
    def output_range(self) -> tuple[int, int] | None:
        """Range of the output potentials over all possible weights and own parameters, or None if unlimited."""
        low = self.hidden * lowest(self.out_bits, self.out_shift) + lowest(self.bias_bits, self.out_bias_shift)
        high = self.hidden * highest(self.out_bits, self.out_shift) + highest(self.bias_bits, self.out_bias_shift)
        return self._range(self.output_ends, low, high, self.out_threshold, self.out_leak_shift)

    def _range(
        self, ends: Callable[..., tuple[int, int] | None], low: int, high: int, threshold: int, shift: int
    ) -> tuple[int, int] | None:
        """Return the range over all own parameters that a host may load, if the neurons have their own."""
        if not self.own_parameters:
            return ends(low, high, threshold, shift)
        # Without leak, and with a threshold lower than a bin adds, a reset by subtraction does not limit a potential.
        return None if self.neuron_reset != "zero" else ends(low, high, largest_threshold(threshold), 0)

    def hidden_ends(self, low: int, high: int, threshold: int, shift: int) -> tuple[int, int] | None:
        """Return the common range of potential and current of a hidden neuron.

        A bin adds from ``low`` to ``high``; ``threshold`` and ``shift`` (of the leak) are those of the neuron.
        """
        synapse = Leak(self.synapse_shift, self.synapse_factor)
        leak = Leak(shift, self.leak_factor)
        return neuron_ends(low, high, synapse, threshold, self.floor, self.neuron_reset, leak)

    def output_ends(self, low: int, high: int, threshold: int, shift: int) -> tuple[int, int] | None:
        """Return the common range of potential and current of an output; see ``hidden_ends``."""
        synapse = Leak(self.out_synapse_shift, self.out_synapse_factor)
        leak = Leak(shift, self.out_leak_factor)
        if self.readout == "membrane":
            return neuron_ends(low, high, synapse, None, None, "zero", leak)
        return neuron_ends(low, high, synapse, threshold, self.out_floor, self.neuron_reset, leak)

    @property
    def saturates(self) -> bool:
        """True if a hidden potential can exceed its register width and must saturate."""
        return bits_of(self.hidden_range) > self.membrane_bits

    @property
    def output_saturates(self) -> bool:
        """True if an output potential can exceed its register width."""
        return bits_of(self.output_range) > self.output_bits

    @property
    def narrow_bits(self) -> int:
        """Bits of a hidden potential for ``HEADROOM`` thresholds, at most ``membrane_bits``.

        Without a floor, or with a synaptic current, large values are part of a neuron's dynamics: its bits stay.
        """
        if self.floor is None or self.synapse_shift:
            return self.membrane_bits
        covered = HEADROOM * max(self.threshold, -self.floor)
        return min(self.membrane_bits, int(bits_of((-covered, covered - 1))))

    # -- construction and exchange ---------------------------------------------------------------

    def to_dict(self) -> dict[str, Any]:
        """Return all fields as a dictionary; without those of ``OPTIONAL`` at their defaults."""
        layers = [[start, end, list(reads)] for start, end, reads in self.layers]
        fields = super().to_dict() | {"layers": layers or ()}
        return {name: value for name, value in fields.items() if name not in OPTIONAL or value != OPTIONAL[name]}


LEAKS = ("leak", "synapse", "out_leak", "out_synapse")
SHIFTS = ("in_shift", "rec_shift", "bias_shift", "out_shift", "out_bias_shift", *(f"{name}_shift" for name in LEAKS))


OPTIONAL: dict[str, Any] = {f"{name}_factor": 1 for name in LEAKS}
OPTIONAL |= {"synapse_shift": 0, "out_synapse_shift": 0, "own_parameters": False, "layers": (), "margin": 0}
"""Fields with their defaults; a file contains a field only if its value is not the default."""


class Leak(NamedTuple):
    """Leak of a potential or current per bin: factor / 2**shift, rounded down; shift 0 means no leak."""

    shift: int
    factor: int = 1


def lowest(bits: int, shift: int = 0) -> int:
    """Return the smallest signed integer of a bit width, shifted left."""
    return -(1 << bits - 1 + shift)


def highest(bits: int, shift: int = 0) -> int:
    """Return the largest signed integer of a bit width, shifted left."""
    return (1 << bits - 1) - 1 << shift


def largest_threshold(common: int) -> int:
    """Return the largest threshold that a host may load into a neuron with own parameters."""
    return (1 << common.bit_length()) - 1


def bits_of(ends: tuple[int, int] | None) -> float:
    """Return the bit width of a signed integer that covers a range; infinite for an unlimited range."""
    if ends is None:
        return math.inf
    low, high = ends
    return max((~low if low < 0 else low).bit_length(), high.bit_length()) + 1


def neuron_ends(
    low: int,
    high: int,
    synapse: Leak,
    threshold: int | None,
    floor: int | None,
    reset: NeuronReset,
    leak: Leak,
) -> tuple[int, int] | None:
    """Return one range for potential and synaptic current of a neuron; see ``ends`` for the parameters."""
    if not synapse.shift:
        return ends(low, high, threshold, floor, reset, leak)
    current = ends(low, high, None, None, "zero", synapse)
    assert current is not None  # it leaks
    potential = ends(*current, threshold, floor, reset, leak)
    return None if potential is None else (min(current[0], potential[0]), max(current[1], potential[1]))


def ends(
    low: int, high: int, threshold: int | None, floor: int | None, reset: NeuronReset, leak: Leak
) -> tuple[int, int] | None:
    """Return the range of a potential over all orders of additions, or None if unlimited.

    ``x - (x * n >> k)`` rises with x, and with A = high its value at X = (((A + 1) << k) - 1) // n is at most X - A.
    So a potential of at most X remains at most X in the next bin. The lower limit follows in the same way with
    X = (low << k) // n. A reset to zero leaves at most the threshold, and so does a reset by subtraction, before or
    after the leak, if a bin adds at most the threshold.

    A bin adds at least ``low`` (at most 0) and at most ``high`` (at least 0). A neuron that does not fire has the
    threshold None.
    """
    if floor is not None:
        least: int | None = floor + low
    else:
        least = (low << leak.shift) // leak.factor if leak.shift or low == 0 else None
    if reset == "delayed" and threshold is not None and least is not None and leak.shift:
        least = min(least, low - threshold)  # a potential just above the threshold leaks below it
    if threshold is not None and (reset == "zero" or high <= threshold):
        most: int | None = threshold + high
    else:
        most = ((high + 1 << leak.shift) - 1) // leak.factor if leak.shift else (0 if high == 0 else None)
    return None if least is None or most is None else (least, most)
