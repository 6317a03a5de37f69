"""Constants of the power model, with unit and source (docs/results/power.md)."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection, Iterable
from dataclasses import dataclass

from eskin.base.configuration import Configuration, parameter
from eskin.base.errors import InputError
from eskin.model.config import MAX_SIDE

PAPER = "Alea et al., BioCAS 2022"
SCRIPTS = "mdalea/intuitive, BioCAS22/plots"
PAPER_TAXELS = 64
"""Number of taxels of the fitted population rates."""

SMALLEST, LARGEST = 1e-15, 1e15
"""Range of noise, time and rates of any sensor.

Parameters may be as small as the square of the smallest value, for Boltzmann's constant.
"""

MIN_RESOLUTION, MAX_RESOLUTION = 1, 10
"""Resolutions N of the power model, as in Fig. 7."""


@dataclass(frozen=True, kw_only=True)
class PowerParameters(Configuration):
    """The constants of both modes of the power model; immutable and validated.

    ``dataclasses.fields(PowerParameters)`` gives unit, source and meaning of each in its ``metadata``; the command
    ``eskin power --parameters`` prints them. The group from ``signal_bandwidth_hz`` on is used only by
    the correction that its meaning names.

    Raises InputError if a value is not a positive finite number, or out of the range of a ratio or a count.
    """

    # The sensor and its requirements.
    rows: int = parameter(8, "", PAPER, "rows of taxels")
    columns: int = parameter(8, "", PAPER, "columns of taxels")
    bandwidth_hz: float = parameter(10e3, "Hz", PAPER, "BW, bandwidth for which the readouts are designed")
    supply_v: float = parameter(1.0, "V", SCRIPTS, "V_DD of everything but the pads")
    swing_v: float = parameter(0.6, "V", SCRIPTS, "usable swing, of the 1 V full scale to which noise refers")
    mean_signal: float = parameter(0.5, "of swing", SCRIPTS, "mean signal into the V-to-I converter")
    # Physics. The values are those of the scripts; CODATA's give an AFE 0.08 % higher.
    boltzmann_j_per_k: float = parameter(1.38e-23, "J/K", SCRIPTS, "k")
    electron_c: float = parameter(1.602e-19, "C", SCRIPTS, "q")
    temperature_k: float = parameter(300.0, "K", SCRIPTS, "T; U_T = kT/q")
    # Analog front end.
    afe_gain: float = parameter(5.0, "", SCRIPTS, "A, closed-loop gain; feedback factors 1/(A+1) and 1/2")
    settling_share: float = parameter(0.1, "of period", SCRIPTS, "part of a sample period in which the AFE settles")
    settling_error_lsb: float = parameter(0.5, "LSB", SCRIPTS, "error left after that time")
    stage_noise_share: float = parameter(0.25, "", SCRIPTS, "share of v_n^2 for kT/C of each of the two stages")
    # The event loop.
    comparator_share: float = parameter(0.1, "of t_loop", SCRIPTS, "part of the loop time for the comparator")
    line_share: float = parameter(0.5, "of t_loop", SCRIPTS, "part for the row and column lines")
    logic_share: float = parameter(0.4, "of t_loop", SCRIPTS, "part for the AER logic")
    settling_time_constants: float = parameter(2.3, "", SCRIPTS, "time constants until 10 % error: ln 10")
    comparator_load_f: float = parameter(10e-15, "F", SCRIPTS, "C_L, load of a comparator")
    comparator_dynamic_f: float = parameter(100e-15, "F", SCRIPTS, "capacitance a comparator switches per event")
    overdrive_v: float = parameter(0.2, "V", SCRIPTS, "V*, 2 I / g_m of the LCS comparator")
    dac_unit_f: float = parameter(10e-15, "F", SCRIPTS, "C0, unit capacitor of the LCS DAC; V_ref = V_DD")
    pulse_current_a: float = parameter(60e-6, "A", SCRIPTS, "pulse into the decay filter that makes the step below")
    pulse_width_s: float = parameter(355e-9, "s", SCRIPTS, "width of that pulse")
    pulse_step_a: float = parameter(1e-9, "A", SCRIPTS, "step dI that this pulse makes")
    line_f: float = parameter(500e-15, "F", SCRIPTS, "capacitance of a row or column line")
    logic_f: float = parameter(100e-15, "F", SCRIPTS, "capacitance of the AER logic of a row or column")
    # Pads and the converter of the frame readout.
    io_voltage_v: float = parameter(5.0, "V", SCRIPTS, "V_IO")
    io_load_f: float = parameter(5e-12, "F", SCRIPTS, "C_out; C_out V_IO^2 = 125 pJ a bit at 5 V")
    io_toggle: float = parameter(1.0, "", SCRIPTS, "share of the address and data bits that are charged")
    sar_j_per_step: float = parameter(10e-15, "J", SCRIPTS, "figure of merit of the SAR converter")
    # Fitted population rates of 64 taxels; other arrays in proportion.
    lcs_rate_2b_hz: float = parameter(2429.0, "events/s", SCRIPTS, "LCS at N = 2, doubling with every bit")
    nlcs_rate_4b_hz: float = parameter(3009.6, "events/s", SCRIPTS, "N-LCS at N = 4 and 0.2 s; as 2^N / tau")
    nlcs_rate_tau_s: float = parameter(0.2, "s", SCRIPTS, "time constant to which that rate belongs")
    # Values of the corrections of `consistent`.
    signal_bandwidth_hz: float = parameter(
        97.0, "Hz", "textures, 99 % of power", "bandwidth of the signal, with correction bandwidth", "bandwidth"
    )
    pads_voltage_v: float = parameter(
        1.8, "V", "usual pad supplies: 5, 3.3, 1.8 V", "V_IO, supply of the pads, with correction pads"
    )
    pads_toggle: float = parameter(0.5, "", "random data: half the bits", "share of charged bits with correction pads")
    noise_efficiency: float = parameter(4.0, "", "published amplifiers: 1.2 to 6", "NEF with correction afe_nef")
    shared_afe_bandwidth: float = parameter(
        1.0, "of M BW", "the NEF formula as it stands", "shared frame AFE with afe_settling and afe_nef"
    )
    logic_j_per_event: float = parameter(
        435e-15, "J/event", "synthesizable 65 nm AER encoder", "digital energy with correction digital, no netlist"
    )

    def __post_init__(self) -> None:
        self._check_types()
        for field in dataclasses.fields(self):
            name, value, unit = field.name, getattr(self, field.name), field.metadata["unit"]
            if isinstance(value, int):
                self._check_range(name, 1, MAX_SIDE)
            elif not (math.isfinite(value) and value > 0):
                raise InputError(f"{name} must be a positive number{f' in {unit}' if unit else ''}, not {value!r}")
            else:
                self._check_range(name, SMALLEST**2, LARGEST)
        for name in (
            *("mean_signal", "settling_share", "settling_error_lsb", "stage_noise_share"),
            *("comparator_share", "line_share", "logic_share", "io_toggle", "pads_toggle"),
        ):
            if getattr(self, name) > 1:
                raise InputError(f"{name} is a share and must be at most 1, not {getattr(self, name)!r}")

    @property
    def taxels(self) -> int:
        """M, number of taxels."""
        return self.rows * self.columns

    @property
    def address_bits(self) -> int:
        """Bits of a row address and a column address together."""
        return (self.rows - 1).bit_length() + (self.columns - 1).bit_length()

    @property
    def lines(self) -> int:
        """Number of row and column lines."""
        return self.rows + self.columns

    @property
    def thermal_energy_j(self) -> float:
        """Thermal energy kT in joules."""
        return self.boltzmann_j_per_k * self.temperature_k

    @property
    def thermal_voltage_v(self) -> float:
        """Thermal voltage U_T = kT/q in volts."""
        return self.thermal_energy_j / self.electron_c

    @classmethod
    def _check_names(cls, names: Collection[str]) -> None:
        if unknown := sorted(set(names) - {field.name for field in dataclasses.fields(cls)}):
            raise InputError(f"unknown parameter {unknown[0]!r}; eskin power --parameters lists them")

    def with_settings(self, settings: Iterable[str]) -> PowerParameters:
        """Return a copy with parameters changed by texts such as ``io_voltage_v=3.3``."""
        changes: dict[str, float] = {}
        for setting in settings:
            name, equals, text = setting.partition("=")
            try:
                changes[name] = int(text) if text.isdecimal() else float(text)
            except ValueError:
                equals = ""
            if not equals:
                raise InputError(f"--set takes NAME=NUMBER, such as io_voltage_v=3.3, not {setting!r}")
        return self.replace(**changes)
