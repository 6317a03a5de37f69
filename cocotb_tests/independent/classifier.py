"""Integer classifier, bin by bin and neuron by neuron, in Python integers."""

from collections.abc import Sequence
from dataclasses import dataclass

Weights = Sequence[Sequence[int]]


def limited(value: int, bits: int) -> int:
    """Return a sum saturated to signed `bits` bits."""
    return max(-(1 << bits - 1), min((1 << bits - 1) - 1, value))


def after(value: int, shift: int, factor: int) -> int:
    """Return a value after a leak."""
    return value - (value * factor >> shift) if shift else value


@dataclass
class Neuron:
    """A neuron with potential, threshold, floor, reset, leak and optional synaptic current."""

    bits: int  # of the potential; each single addition stops at their ends
    bias: int  # added once a bin
    threshold: int  # it fires above
    floor: int | None  # what the potential is held above
    leak: tuple[int, int]  # shift and factor: the share factor / 2**shift is lost from bin to bin; shift 0: nothing
    synapse: tuple[int, int]  # the same of the current; shift 0: there is no current, weights go to the potential
    reset: str  # by a spike: the potential becomes 0 (zero), or the threshold is subtracted before the leak (subtract)
    fires: bool = True  # False: a neuron whose potential is read, not its spikes

    def __post_init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Reset the neuron; the first bin starts with the bias."""
        self.potential, self.gathered = 0, limited(self.bias, self.bits)

    def add(self, weight: int) -> None:
        """Add a weight to the current if present, else to the potential."""
        self.gathered = limited(self.gathered + weight, self.bits)

    def end_bin(self) -> tuple[int, bool]:
        """Apply floor, comparison and reset, then leak and bias; return the compared potential and whether it fires."""
        value = limited(self.potential + self.gathered, self.bits) if self.synapse[0] else self.gathered
        value = value if self.floor is None else max(value, self.floor)
        fires = self.fires and value > self.threshold
        left = value
        if fires and self.reset != "delayed":
            left = value - self.threshold if self.reset == "subtract" else 0
        self.potential = after(left, *self.leak)
        if fires and self.reset == "delayed":  # the threshold is subtracted after the leak
            self.potential -= self.threshold
        remains = after(self.gathered, *self.synapse) if self.synapse[0] else self.potential
        self.gathered = limited(remains + self.bias, self.bits)
        return value, fires


@dataclass
class Network:
    """Network of recurrent hidden neurons and output neurons."""

    # rows of weights; shifts are applied already
    w_in: Weights
    w_rec: Weights
    w_out: Weights
    hidden: list[Neuron]
    outputs: list[Neuron]
    evidence_bits: int  # of the evidence, which stops at their ends
    groups: Sequence[int]  # number of the group of each hidden neuron; the outputs read the last group
    margin: int = 0  # an early decision needs so much more evidence than any other class; 0: there is none

    def __post_init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Start a new scan."""
        for neuron in self.hidden + self.outputs:
            neuron.restart()
        self.fired: list[int] = []
        self.evidence = [0] * len(self.outputs)
        self.sure = False
        self.bins = 0

    def end_bin(self, neuron: Neuron, group: int) -> tuple[int, bool]:
        """End the bin of a neuron; before the first bin has come through the groups before it, it starts again."""
        if self.bins >= group:
            return neuron.end_bin()
        neuron.restart()
        return 0, False

    def run_bin(self, channels: Sequence[int]) -> tuple[int, list[int], list[int], list[int], list[int]]:
        """Process one bin with its events in order.

        Return class, evidence, potentials of the hidden neurons, which of them fired, and potentials of the outputs.
        """
        for channel in channels:
            for n, neuron in enumerate(self.hidden):
                neuron.add(self.w_in[channel][n])
        for source in self.fired:
            for n, neuron in enumerate(self.hidden):
                neuron.add(self.w_rec[source][n])
        ends = [self.end_bin(neuron, group) for neuron, group in zip(self.hidden, self.groups, strict=True)]
        self.fired = [n for n, (_, fires) in enumerate(ends) if fires]
        for source in self.fired:
            for c, neuron in enumerate(self.outputs):
                neuron.add(self.w_out[source][c])
        out_ends = [self.end_bin(neuron, max(self.groups)) for neuron in self.outputs]
        self.bins += 1
        for c, (potential, fires) in enumerate(out_ends):
            gain = int(fires) if self.outputs[c].fires else potential
            self.evidence[c] = limited(self.evidence[c] + gain, self.evidence_bits)
        best = self.evidence.index(max(self.evidence))
        others = [evidence for c, evidence in enumerate(self.evidence) if c != best]
        if self.margin and all(evidence + self.margin <= self.evidence[best] for evidence in others):
            self.sure = True
        return best, list(self.evidence), [v for v, _ in ends], list(self.fired), [v for v, _ in out_ends]
