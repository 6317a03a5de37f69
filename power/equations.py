"""Power equations of the three readouts, as published and with named corrections.

With no correction this is the model behind Fig. 5 to 7 of the paper (mode ``paper``); with all of them it is mode
``consistent``. There is one set of equations: a correction changes one quantity in them. Equations, sources and
outcome: docs/results/power.md.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eskin.base.errors import InputError
from eskin.model.encoders import registry
from eskin.power.parameters import LARGEST, MAX_RESOLUTION, MIN_RESOLUTION, PAPER_TAXELS, SMALLEST, PowerParameters
from eskin.power.readouts import READOUTS, SPIKING, Readout, published
from eskin.power.synthesis import SynthesisReport

FloatArray = NDArray[np.float64]

PowerMode = Literal["paper", "consistent"]

CORRECTIONS = {
    "afe_settling": "the shared frame AFE settles M times faster",
    "event_rates": "event rates from the encoders on the data, not from fits",
    "comparators": "every taxel's comparator at its own event rate",
    "bandwidth": "bandwidth of the textures instead of 10 kHz",
    "pads": "1.8 V pads, half of the data bits toggle",
    "afe_nef": "AFE by its noise-efficiency factor",
    "digital": "logic from synthesised gates instead of a guessed capacitance",
}
"""The corrections of mode ``consistent``, in the order of docs/results/power.md."""

NOISE_RANGE_V = (1e-9, 1e3)
"""Range of the search for crossovers; the original's search also ended at 1000 V."""

_EVEN = 1e-12  # relative difference of two totals that is only rounding


@dataclass(frozen=True)
class TaxelRates:
    """Event rates of an array, reduced to the sums that the power equations need."""

    population_hz: FloatArray  # events/s of the whole array
    square_sum_hz2: FloatArray  # sum of the squared events/s of all taxels; same shape

    @classmethod
    def uniform(cls, population_hz: FloatArray, taxels: int) -> TaxelRates:
        """Return the rates of an array with equal rates in all taxels."""
        return cls(population_hz, population_hz**2 / taxels)


class RateSource(Protocol):
    """Interface of a source of event rates."""

    def taxel_rates(self, readout: Readout, resolution: FloatArray, tau_s: FloatArray, taxels: int) -> TaxelRates:
        """Return the event rates of a spiking readout, in the common shape of resolution and tau_s."""
        ...


@dataclass(frozen=True)
class FittedRates:
    """Fitted event rates of the original model, given for 64 taxels.

    The rate of LCS is 2429 * 2^(N-2) events/s. The rate of N-LCS is 3009.6 * 2^(N-4) * 0.2 s / tau events/s.
    """

    parameters: PowerParameters

    def taxel_rates(self, readout: Readout, resolution: FloatArray, tau_s: FloatArray, taxels: int) -> TaxelRates:
        """Return the event rates of a spiking readout; see ``RateSource``."""
        p = self.parameters
        rate = published(
            readout,
            lcs=p.lcs_rate_2b_hz * 2.0 ** (resolution - 2) * np.ones_like(tau_s),
            nlcs=p.nlcs_rate_4b_hz * 2.0 ** (resolution - 4) * (p.nlcs_rate_tau_s / tau_s),
        )
        return TaxelRates.uniform(rate * (taxels / PAPER_TAXELS), taxels)


@dataclass(frozen=True)
class Breakdown:
    """Power of the parts of a readout in watts, in the common shape of resolution, noise and tau."""

    afe: FloatArray  # analog front end of the whole array
    converter_parts: dict[str, FloatArray]  # everything between AFE and pads, by part
    io: FloatArray  # pads

    @property
    def converter(self) -> FloatArray:
        """Total converter power in watts."""
        return np.asarray(sum(self.converter_parts.values()))

    @property
    def total(self) -> FloatArray:
        """Total power of AFE, converter and I/O in watts."""
        return self.afe + self.converter + self.io

    def to_dict(self) -> dict[str, Any]:
        """Return all powers in watts as a dictionary."""
        watts = {name: getattr(self, name).tolist() for name in ("afe", "converter", "io", "total")}
        return watts | {"converter_parts": {name: value.tolist() for name, value in self.converter_parts.items()}}


@dataclass(frozen=True)
class Crossover:
    """AFE noise at which a spiking readout and frames need equal power."""

    noise_v_rms: float | None  # AFE output noise in volts at which the totals are equal; None if they never are
    spikes_win: Literal["above", "below", "always", "never"]  # side on which spikes cost less


@dataclass(frozen=True, kw_only=True)
class PowerModel:
    """The power model with a set of corrections.

    Raises InputError if a correction is unknown, or ``event_rates`` has no rates.
    """

    parameters: PowerParameters = field(default_factory=PowerParameters)
    # keys of ``CORRECTIONS``; none is mode ``paper``, all of them mode ``consistent``
    corrections: frozenset[str] = frozenset()
    measured: RateSource | None = None  # event rates of the encoders on data; needed by correction ``event_rates``
    # synthesis reports by readout, for correction ``digital``; without one, spiking logic takes the published energy
    # per event, and the frame sequencer nothing
    gates: Mapping[str, SynthesisReport] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_corrections(self.corrections)
        if "event_rates" in self.corrections and self.measured is None:
            raise InputError("correction event_rates needs measured rates; measure them or leave it out")

    def breakdown(
        self, readout: Readout, resolution: ArrayLike, noise_v_rms: ArrayLike, tau_s: ArrayLike = 0.2
    ) -> Breakdown:
        """Return the power of the parts of a readout.

        - ``resolution``: N, 1..10. The three numbers broadcast against each other.
        - ``noise_v_rms``: AFE output noise in volts rms, for a full scale of 1 V.
        - ``tau_s``: N-LCS time constant in seconds; the other readouts do not depend on it.

        Raises InputError if the readout is unknown or a number is out of range.
        """
        if readout not in READOUTS:
            raise InputError(f"readout must be one of {', '.join(READOUTS)}, not {readout!r}")
        bits = _checked_resolution(resolution)
        noise = _positive(noise_v_rms, "noise", "volts")
        tau = _positive(tau_s, "tau", "seconds")
        bits, noise, tau = (np.array(a) for a in np.broadcast_arrays(bits, noise, tau))
        if readout == "frame":
            parts, io = self._frame(bits)
        else:
            rates = self.taxel_rates(readout, bits, tau)
            parts = published(readout, lcs=self._lcs, nlcs=self._nlcs)(bits, rates)
            data_bits = self.parameters.address_bits + registry.named(readout).polarity  # beside REQ and ACK
            io = (data_bits * self.toggle + 2) * self.bit_j * rates.population_hz
        return Breakdown(self._afe(readout, bits, noise), parts, io)

    def crossover(self, readout: Readout, resolution: int, tau_s: float = 0.2) -> Crossover:
        """Return the AFE noise at which a spiking readout and frames need equal power.

        Only the AFE depends on the noise, as 1/v_n^2, so there is at most one; it is solved for as a root of
        log(P_spiking / P_frame) over log(v_n).
        """
        from scipy import optimize

        if readout not in SPIKING:
            raise InputError(f"a crossover needs a spiking readout, {' or '.join(SPIKING)}, not {readout!r}")
        spiking, frame = (self.breakdown(name, resolution, 1.0, tau_s) for name in (readout, "frame"))

        def log_ratio(log_noise: float) -> float:
            squared = math.exp(2 * log_noise)
            totals = [float(b.afe) / squared + float(b.converter + b.io) for b in (spiking, frame)]
            difference = totals[0] - totals[1]
            return 0.0 if abs(difference) < _EVEN * totals[1] else math.log(totals[0] / totals[1])

        ends = [math.log(v) for v in NOISE_RANGE_V]
        low, high = log_ratio(ends[0]), log_ratio(ends[1])
        if low * high >= 0:
            return Crossover(None, "always" if low + high < 0 else "never")
        root = math.exp(optimize.brentq(log_ratio, *ends, xtol=1e-14, rtol=1e-14))
        return Crossover(root, "above" if low > 0 else "below")

    def taxel_rates(self, readout: Readout, resolution: FloatArray, tau_s: FloatArray) -> TaxelRates:
        """Return the event rates of a spiking readout in the model."""
        source: RateSource = FittedRates(self.parameters)
        if "event_rates" in self.corrections:
            assert self.measured is not None
            source = self.measured
        return source.taxel_rates(readout, resolution, tau_s, self.parameters.taxels)

    @property
    def bandwidth_hz(self) -> float:
        """BW, signal bandwidth in hertz."""
        p = self.parameters
        return p.signal_bandwidth_hz if "bandwidth" in self.corrections else p.bandwidth_hz

    @property
    def bit_j(self) -> float:
        """Energy to charge a pad once, C_out V_IO^2 in joules."""
        p = self.parameters
        return p.io_load_f * (p.pads_voltage_v if "pads" in self.corrections else p.io_voltage_v) ** 2

    @property
    def toggle(self) -> float:
        """Share of data bits that charge their pad."""
        p = self.parameters
        return p.pads_toggle if "pads" in self.corrections else p.io_toggle

    def _afe(self, readout: Readout, resolution: FloatArray, noise_v_rms: FloatArray) -> FloatArray:
        """Return the AFE power: two weak-inversion stages limited by settling, or limited by noise efficiency."""
        p = self.parameters
        copies = 1 if readout == "frame" else p.taxels
        # One amplifier behind the multiplexer serves all taxels in turn.
        in_turn = float(p.taxels) if readout == "frame" and "afe_settling" in self.corrections else 1.0
        if "afe_nef" in self.corrections:
            input_noise = noise_v_rms / p.afe_gain
            in_turn *= p.shared_afe_bandwidth if in_turn > 1 else 1
            factor = p.noise_efficiency**2 * 2 * math.pi * p.thermal_energy_j * p.thermal_voltage_v
            return copies * p.supply_v * factor * self.bandwidth_hz * in_turn / input_noise**2
        if readout == "frame":
            sample_rate_hz = 2 * self.bandwidth_hz * in_turn * np.ones_like(resolution)
        else:  # levels per second of a full-scale sine at BW
            sample_rate_hz = 2.0**resolution * math.pi * self.bandwidth_hz
        settling_s = p.settling_share / sample_rate_hz
        time_constant_s = settling_s / -np.log(p.settling_error_lsb * 2.0**-resolution)
        capacitance = p.thermal_energy_j / (p.stage_noise_share * noise_v_rms**2)
        current = np.zeros_like(noise_v_rms)
        for feedback in (1 / (p.afe_gain + 1), 1 / 2):
            transconductance = 2 * math.pi / (feedback * time_constant_s) * capacitance
            current = current + 2 * transconductance * p.thermal_voltage_v
        return copies * p.supply_v * current

    def _comparator_bandwidth_hz(self, event_rate_hz: FloatArray) -> FloatArray:
        """Return the bandwidth BW_c of a comparator that has its share of the loop time 1 / event_rate_hz."""
        p = self.parameters
        return p.settling_time_constants / (2 * math.pi * p.comparator_share) * event_rate_hz

    def _lsb_rms_v(self, resolution: FloatArray) -> FloatArray:
        """Return the quantisation noise of the usable swing in volts rms."""
        return self.parameters.swing_v * 2.0**-resolution / math.sqrt(12)

    def _lcs(self, resolution: FloatArray, rates: TaxelRates) -> dict[str, FloatArray]:
        """Return the power of the parts of the LCS converter.

        The original has one comparator pair, at the population rate. M pairs at their own rates cost the same,
        since the power is linear in the rate: correction ``comparators`` changes nothing here.
        """
        p, rate = self.parameters, rates.population_hz
        gain = p.supply_v / self._lsb_rms_v(resolution)
        current = gain * self._comparator_bandwidth_hz(rate) * p.overdrive_v * 2 * math.pi * p.comparator_load_f
        return {
            "comparator_static": 2 * current * p.supply_v,
            "comparator_dynamic": 2 * p.comparator_dynamic_f * p.supply_v**2 * rate,
            "dac": self._dac(resolution, rate),
            **self._periphery("lcs", rate),
        }

    def _dac(self, resolution: FloatArray, rate: FloatArray) -> FloatArray:
        """Return the power to charge the reference DAC at mid-scale for every event."""
        p, code = self.parameters, 2.0 ** (resolution - 1)
        return np.asarray(code * p.dac_unit_f * p.supply_v**2 * (1 - code / 2.0**resolution) * rate)

    def _nlcs(self, resolution: FloatArray, rates: TaxelRates) -> dict[str, FloatArray]:
        """Return the power of the parts of the N-LCS converter.

        All currents follow 1/R_eq, which is in proportion to the comparator's bandwidth and so to an event rate:
        the original gives every taxel that of the whole population, correction ``comparators`` its own. Where the
        netlist of a report holds the reference and lets it leak, a DAC stands in the place of the decay filter.
        """
        report = self.gates.get("nlcs") if "digital" in self.corrections else None
        p, rate = self.parameters, rates.population_hz
        per_hz = 2 * math.pi * self._comparator_bandwidth_hz(np.ones_like(rate)) * p.comparator_load_f
        siemens_per_hz = per_hz * p.supply_v / self._lsb_rms_v(resolution)  # 1/R_eq per event/s
        if "comparators" in self.corrections:
            rate_sum, rate_product = rate, rates.square_sum_hz2
        else:
            rate_sum, rate_product = rate * p.taxels, rate * rate
        full_scale_a = p.swing_v * siemens_per_hz * rate_sum  # of all taxels
        threshold_a = full_scale_a / 2.0**resolution
        pulse_s = p.pulse_current_a * p.pulse_width_s / p.pulse_step_a  # charge per step of current
        events_a = 2 * (p.swing_v * siemens_per_hz / 2.0**resolution) * pulse_s * rate_product
        if report and report.leak == "digital":
            reference = {"dac": self._dac(resolution, rates.population_hz)}
        else:
            reference = {"decay_filter": p.supply_v * (events_a + full_scale_a)}
        return {
            "v_to_i": p.supply_v * p.mean_signal * full_scale_a,
            "comparator_static": p.supply_v * threshold_a,
            "comparator_dynamic": p.comparator_dynamic_f * p.supply_v**2 * rate,
            **reference,
            **self._periphery("nlcs", rate),
        }

    def _periphery(self, readout: Readout, rate: FloatArray) -> dict[str, FloatArray]:
        """Return the power of the row lines, the column lines and the logic of a spiking readout."""
        p = self.parameters
        bias = p.line_f * p.supply_v**2 * rate / p.line_share * p.lines
        if "digital" not in self.corrections:
            logic = p.logic_f * p.supply_v**2 * p.lines * rate / p.logic_share
        elif report := self.gates.get(readout):
            logic = report.power_w(p.taxels, rate)
        else:
            logic = p.logic_j_per_event * rate
        return {"line_bias": bias, "logic": logic}

    def _frame(self, resolution: FloatArray) -> tuple[dict[str, FloatArray], FloatArray]:
        """Return the power of the converter's parts and the I/O of the frame readout."""
        p = self.parameters
        samples_hz = 2 * self.bandwidth_hz * p.taxels * np.ones_like(resolution)
        parts = {"adc": p.sar_j_per_step * 2.0**resolution * samples_hz}
        if "digital" in self.corrections and (report := self.gates.get("frame")):
            parts["logic"] = report.power_w(p.taxels, samples_hz)
        return parts, resolution * samples_hz * self.bit_j * self.toggle


def check_corrections(names: Iterable[str]) -> frozenset[str]:
    """Return the names of corrections as a set; raise an error for an unknown name."""
    chosen = frozenset(names)
    if unknown := sorted(chosen - set(CORRECTIONS)):
        raise InputError(f"unknown correction {unknown[0]!r}; known are {', '.join(CORRECTIONS)}")
    return chosen


def _checked_resolution(resolution: ArrayLike) -> FloatArray:
    """Return N as a float array after checking for whole numbers in 1..10."""
    values = np.asarray(resolution, np.float64)
    bad = ~((values >= MIN_RESOLUTION) & (values <= MAX_RESOLUTION) & (values == np.rint(values)))
    if bad.any():
        raise InputError(
            f"resolution must be a whole number in {MIN_RESOLUTION}..{MAX_RESOLUTION}, not {values[bad].flat[0]:g}"
        )
    return values


def _positive(value: ArrayLike, name: str, unit: str) -> FloatArray:
    """Return values as a float array; raise an error unless all are positive and in a safe range."""
    values = np.asarray(value, np.float64)
    bad = ~(np.isfinite(values) & (values > 0))
    if bad.any():
        raise InputError(f"{name} must be a positive number of {unit}, not {values[bad].flat[0]:g}")
    beyond = (values < SMALLEST) | (values > LARGEST)
    if beyond.any():
        raise InputError(f"{name} must be in {SMALLEST:g}..{LARGEST:g} {unit}, not {values[beyond].flat[0]:g}")
    return values
