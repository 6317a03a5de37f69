"""Netlists of the analog taxel: StrongARM comparators, capacitor DACs and sample switches, sized by parameters.

A taxel has one side for ON and, with polarity, one for OFF. The top plate of a side samples the signal x while the
bottom plates are at the code of mid scale. Then the bottom plates move to the reference and the half-width, so that the
top plate is at x - reference - h (ON) or x - reference + h (OFF) above half the supply, and the comparator compares it
with half the supply. The comparator always works at the same common mode.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from eskin.analog.models import CORNERS, NMOS, PMOS, Corner, models, sizes
from eskin.base.configuration import Configuration, parameter
from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig

OURS = "this project"
PINS = ("clk", "inp", "inn", "outp", "outn", "vdd", "vss")
"""Pins of the subcircuit ``comparator``. It decides with the rising edge of ``clk``:
outp is high and outn is low if inp is above inn. Both hold until the next rising edge."""

DIFFUSION_UM = 0.29
"""Length of source and drain of a transistor, for the capacitances and leakage of their junctions."""


@dataclass(frozen=True, kw_only=True)
class FrontEnd(Configuration):
    """The sizes and conditions of an analog front end."""

    noun = ("a front end", "front end")

    supply_v: float = parameter(1.8, "V", "SKY130, nominal", "supply and reference of the DAC")
    corner: Corner = parameter("tt", "", "SKY130", "corner of the transistors: NMOS, then PMOS")
    temperature_c: float = parameter(27.0, "C", OURS, "temperature")
    unit_f: float = parameter(0.5e-15, "F", OURS, "unit capacitor of the DAC, a metal fringe capacitor")
    bottom_share: float = parameter(0.1, "of C", OURS, "capacitance from a bottom plate to ground")
    input_w_um: float = parameter(4.0, "um", OURS, "width of the comparator's input transistors")
    input_l_um: float = parameter(0.5, "um", OURS, "length of the comparator's input transistors")
    core_w_um: float = parameter(0.84, "um", OURS, "width of the comparator's tail and cross-coupled transistors")
    gate_w_um: float = parameter(0.42, "um", OURS, "width of all other transistors")
    gate_l_um: float = parameter(0.15, "um", "SKY130, smallest", "length of all transistors but the input pair")
    comparator: str = parameter("", "", OURS, "netlist with a subcircuit comparator; by default a StrongARM latch")

    def __post_init__(self) -> None:
        self._check_types()
        if not 0.9 <= self.supply_v <= 1.95:
            raise InputError(f"supply_v must be in 0.9..1.95, not {self.supply_v}")
        if self.corner not in CORNERS:
            raise InputError(f"corner must be one of {', '.join(CORNERS)}, not {self.corner!r}")
        self._check_range("temperature_c", -40, 125)
        self._check_range("unit_f", 1e-16, 1e-13)

    @cached_property
    def cells(self) -> str:
        """Gates and comparator as subcircuits."""
        if self.comparator and f".subckt comparator {' '.join(PINS)}" not in " ".join(self.comparator.lower().split()):
            raise InputError(f"the netlist must have a line '.subckt comparator {' '.join(PINS)}'")
        return _gates(self) + (self.comparator.strip() + "\n" if self.comparator else _strong_arm(self))

    def circuit(self, *lines: str) -> str:
        """Return a netlist: lines of a circuit, with the cells, the models that it needs, and the supply."""
        text = "\n".join([self.cells, *lines])
        options = f".options method=gear gmin=1e-15 temp={self.temperature_c:g}"
        supply = f"Vdd vdd 0 {self.supply_v:g}\nVcm vcm 0 {self.supply_v / 2:g}"
        return "\n".join([text, supply, options, models(self.corner, sizes(text))])


def transistor(name: str, nodes: str, model: str, w_um: float, l_um: float) -> str:
    """Return the line of a transistor, with the areas and perimeters of its junctions."""
    area, edge = w_um * DIFFUSION_UM, 2 * (w_um + DIFFUSION_UM)
    junctions = " ".join(f"a{side}={area:.4g}p p{side}={edge:.4g}u" for side in "sd")
    return f"M{name} {nodes} {model} w={w_um:g}u l={l_um:g}u {junctions}"


def _gates(f: FrontEnd) -> str:
    w, length = f.gate_w_um, f.gate_l_um

    def inverter(w: float) -> list[str]:
        return [transistor("n", "y a vss vss", NMOS, w, length), transistor("p", "y a vdd vdd", PMOS, 2 * w, length)]

    return "\n".join(
        [
            ".subckt nor a b y vdd vss",
            *(transistor(f"n{g}", f"y {g} vss vss", NMOS, w, length) for g in "ab"),
            transistor("pa", "m a vdd vdd", PMOS, 2 * w, length),
            transistor("pb", "y b m vdd", PMOS, 2 * w, length),
            ".ends",
            ".subckt plate a conv b convn y vdd vss",  # not (a and conv or b and convn)
            transistor("na", "y a m vss", NMOS, w, length),
            transistor("nc", "m conv vss vss", NMOS, w, length),
            transistor("nb", "y b n vss", NMOS, w, length),
            transistor("nd", "n convn vss vss", NMOS, w, length),
            *(transistor(f"p{g}", f"q {g} vdd vdd", PMOS, 2 * w, length) for g in ("a", "conv")),
            *(transistor(f"p{g}", f"y {g} q vdd", PMOS, 2 * w, length) for g in ("b", "convn")),
            ".ends",
            ".subckt inverter a y vdd vss",
            *inverter(w),
            ".ends",
            ".subckt buffer a y vdd vss",  # inverts, for several gates
            *inverter(2 * w),
            ".ends",
            ".subckt switch a b on off vdd vss",
            transistor("n", "a on b vss", NMOS, 2 * w, length),
            transistor("p", "a off b vdd", PMOS, 2 * w, length),
            ".ends\n",
        ]
    )


def _strong_arm(f: FrontEnd) -> str:
    """Return a StrongARM comparator of 11 transistors with a latch of two NORs.

    Inverters in front of the latch keep its state from loading one side more than the other, which would shift the
    threshold by some 3 mV towards the answer before.
    """
    core, gate, length = f.core_w_um, f.gate_w_um, f.gate_l_um
    return "\n".join(
        [
            f".subckt comparator {' '.join(PINS)}",
            transistor("tail", "t clk vss vss", NMOS, core, length),
            transistor("inp", "xn inp t vss", NMOS, f.input_w_um, f.input_l_um),
            transistor("inn", "xp inn t vss", NMOS, f.input_w_um, f.input_l_um),
            transistor("nn", "sn sp xn vss", NMOS, core, length),
            transistor("np", "sp sn xp vss", NMOS, core, length),
            transistor("pn", "sn sp vdd vdd", PMOS, core, length),
            transistor("pp", "sp sn vdd vdd", PMOS, core, length),
            *(transistor(f"r{node}", f"{node} clk vdd vdd", PMOS, gate, length) for node in ("sn", "sp", "xn", "xp")),
            "Xs sn s vdd vss inverter",
            "Xr sp r vdd vss inverter",
            "Xp r outn outp vdd vss nor",
            "Xn s outp outn vdd vss nor",
            ".ends\n",
        ]
    )


@dataclass(frozen=True)
class Taxel:
    """The circuit of one taxel of a readout with the analog front end.

    The DAC has a capacitor for every bit of the reference above the encoder's grid; an unsigned reference has its
    highest bit inverted, so that the middle of the scale is always half the supply.
    """

    front_end: FrontEnd
    config: ReadoutConfig
    offsets_v: tuple[float, float] = (0.0, 0.0)  # of the comparators for ON and OFF, in series with inn

    @property
    def sides(self) -> tuple[str, ...]:
        """The sides: ON, and OFF with polarity."""
        return ("on", "off") if self.config.has_polarity else ("on",)

    @property
    def outputs(self) -> tuple[tuple[str, str], ...]:
        """Nodes at the two outputs of each comparator; a signal below the lower threshold is low at that of OFF."""
        return (("above", "onlow"), ("offhigh", "below"))[: len(self.sides)]

    @property
    def grid(self) -> int:
        """Codes of a sample in a unit of the DAC."""
        return self.config.grid

    @property
    def bits(self) -> int:
        """Bits of the DAC."""
        return self.config.sample_bits - (self.grid - 1).bit_length() - (not self.config.has_polarity)

    @property
    def middle(self) -> int:
        """Code of the middle of the scale, in units of the DAC."""
        return 0 if self.config.has_polarity else 1 << (self.bits - 1)

    @property
    def widest(self) -> int:
        """Largest half-width in units of the DAC; of a strict encoder, one code more than D."""
        return self.config.step // self.grid + self.config.encoder.strict

    @property
    def width_bits(self) -> int:
        """Bits of the half-width."""
        return self.widest.bit_length()

    def reference_bits(self, reference: int) -> list[bool]:
        """Return the bits of a reference in codes, the lowest first; the highest is high below the middle."""
        return [bool((reference // self.grid - self.middle) >> bit & 1) for bit in range(self.bits)]

    def width_levels(self, half_width: int) -> list[bool]:
        """Return the bits of a half-width in codes."""
        return [
            bool((half_width // self.grid + self.config.encoder.strict) >> bit & 1) for bit in range(self.width_bits)
        ]

    def codes(self, reference: int, half_width: int) -> list[str]:
        """Return the sources of the lines r0.. and h0.., from a reference and a half-width in codes."""
        lines = {f"r{bit}": high for bit, high in enumerate(self.reference_bits(reference))}
        lines |= {f"h{bit}": high for bit, high in enumerate(self.width_levels(half_width))}
        return [f"V{name} {name} 0 {self.front_end.supply_v * high:g}" for name, high in lines.items()]

    @property
    def units(self) -> int:
        """Unit capacitors of a side."""
        return (1 << self.bits) + (1 << self.width_bits) - 1

    @property
    def unit_v(self) -> float:
        """Voltage of a unit of the DAC, with ideal capacitors and a comparator without input capacitance."""
        return self.front_end.supply_v / self.units

    def volts(self, code: float) -> float:
        """Return the voltage of a signal in codes."""
        return self.front_end.supply_v / 2 + (code / self.grid - self.middle) * self.unit_v

    def inputs_v(self, x_v: float, reference: int, half_width: int, gain: float) -> list[float]:
        """Return what the comparators of all sides see between their inputs; reference and half-width in codes."""
        level = reference / self.grid - self.middle
        width = half_width / self.grid + self.config.encoder.strict
        signs = (1, -1)[: len(self.sides)]
        return [x_v - self.front_end.supply_v / 2 - (level + sign * width) * gain * self.unit_v for sign in signs]

    @property
    def plates(self) -> dict[str, int]:
        """Bottom plates that both sides share, with their unit capacitors; the last serves negative references."""
        return {f"b{bit}": 1 << bit for bit in range(self.bits - 1)} | {f"b{self.bits - 1}": 1}

    def width_plates(self, side: str) -> dict[str, int]:
        """Return the bottom plates of a side's half-width, with their unit capacitors."""
        return {f"h{side}{bit}": 1 << bit for bit in range(self.width_bits)}

    def netlist(self) -> list[str]:
        """Return the lines of the taxel; its nodes are x, ckn, smpn, convn, r0.., h0.., above and below.

        The bottom plates of both sides share the gates of the reference. The strobe, the sample switch and the plates
        have their buffers in the taxel; the lines are active low.
        """
        top = self.bits - 1
        lines = [f"X{name} {name}n {name} vdd 0 buffer" for name in ("smp", "conv")]
        lines.append(f"Xsign r{top} positive vdd 0 inverter")
        lines += [f"Xb{bit} r{bit} conv r{top} convn b{bit} vdd 0 plate" for bit in range(top)]
        lines.append(f"Xb{top} positive conv vdd convn b{top} vdd 0 plate")
        for bit in range(self.width_bits):
            lines.append(f"Xhon{bit} h{bit} conv 0 convn hon{bit} vdd 0 plate")
            if "off" in self.sides:
                lines.append(f"Xhoff{bit} hon{bit} vdd 0 0 hoff{bit} vdd 0 plate")
        f = self.front_end
        for plate in self.dummies:
            lines.append(transistor(plate, f"{plate} vdd 0 0", NMOS, f.gate_w_um, 2 * f.gate_l_um))
        for side in self.sides:
            lines.append(f"Xs{side} x top{side} smp smpn vdd 0 switch")
            lines.append(f"Xm{side} vcm middle smp smpn vdd 0 switch")
        return lines + self.comparators()

    @property
    def dummies(self) -> dict[str, int]:
        """Bottom plates of the comparators' other input, with their unit capacitors.

        It has the capacitors of the top plates behind transistors like those of the gates, so that the kick of the
        comparators cancels.
        """
        own = self.plates | self.width_plates("on")
        return {f"m{plate}": len(self.sides) * units for plate, units in own.items()}

    def comparators(self) -> list[str]:
        """Return the lines of comparators and capacitors; their nodes are ckn, the plates, above and below."""
        pad = 1 << self.bits - 1
        lines = ["Xck ckn ck vdd 0 buffer", *self._capacitors("middle", self.dummies | {"0": len(self.sides) * pad})]
        for side, (positive, negative), offset_v in zip(self.sides, self.outputs, self.offsets_v, strict=False):
            lines += self._capacitors(f"top{side}", self.plates | self.width_plates(side) | {"0": pad})
            lines += [
                f"V{side} {side}n middle {offset_v:g}",
                f"Xc{side} ck top{side} {side}n {positive} {negative} vdd 0 comparator",
            ]
        # The latches begin in one of their two stable states.
        outs = [name for side in self.outputs for name in side]
        supply = self.front_end.supply_v
        states = (f"v({out})={supply * (place % 2):g}" for place, out in enumerate(outs))
        return [*lines, *(f"Cload{out} {out} 0 2f" for out in outs), " ".join([".nodeset", *states])]

    def _capacitors(self, top: str, plates: dict[str, int]) -> list[str]:
        """Return capacitors from a top plate to bottom plates, with those of the bottom plates to ground."""
        lines = []
        for plate, units in plates.items():
            f = self.front_end.unit_f * units
            lines.append(f"C{top}{plate} {top} {plate} {f:.4g}")
            if plate != "0":
                lines.append(f"Cg{top}{plate} {plate} 0 {f * self.front_end.bottom_share:.4g}")
        return lines
