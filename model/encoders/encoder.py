"""Interface of an encoder: its properties, its rule, its decoder and its error bounds.

The functions under "compiled" are plain Python that Numba understands; ``eskin.model.encoders.compiled`` compiles them.
Numba selects the encoder by the type of ``rule``, so every encoder needs its own rule class with a unique name.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

if TYPE_CHECKING:  # a configuration knows its encoder, so no encoder imports the configuration
    from eskin.model.config import ReadoutConfig


class Constants(NamedTuple):
    """Constants of an encoder for the compiled functions; steps are in 2**-fraction_bits codes.

    A host may set the first five (``with_settings`` of ``eskin.model.encoders.compiled``). The last three are as built:
    log2 of D, log2 of the number of half-widths of a window, and the most events of a tick.
    """

    step: int
    closing_step: int
    window_period: int
    leak_shift: int
    leak_period: int
    fraction_bits: int
    step_log2: int
    levels_log2: int
    cap: int


class Encoder(ABC):
    """The rule by which a taxel converts samples into events."""

    name: ClassVar[str]  # in configurations and commands
    title: ClassVar[str]  # in tables and figures
    colour: ClassVar[str]  # of its line in figures, for Matplotlib
    marker: ClassVar[str]
    code: ClassVar[int]  # number in the register ``shape.encoding``, 0..7; never given to another encoder
    parameters: ClassVar[tuple[str, ...]] = ()  # fields of ``ReadoutConfig`` that this encoder reads, and others do not
    polarity: ClassVar[bool] = True
    """Events are ON or OFF. Without polarity all events are ON, the reference never goes below zero, and a sample below
    zero counts as zero."""
    leaks: ClassVar[bool] = False  # the reference leaks at decay ticks
    windowed: ClassVar[bool] = False  # every taxel has a window, which closes while no event happens
    strict: ClassVar[bool] = False  # ON needs x - u > D; otherwise x - u >= the half-width of the window
    frontends: ClassVar[tuple[str, ...]] = ("digital", "analog")
    """Front ends that the encoder supports. Analog comparators have one half-width for both thresholds."""
    timed: ClassVar[bool] = False  # the decoder must know which events came late
    Rule: ClassVar[Any]
    """A subclass of ``Constants`` of its own, or a named tuple with the fields of ``Constants`` and of
    ``extra_constants``."""
    state: ClassVar[tuple[str, ...]] = ()  # additional state of a taxel besides sample and reference; 0 after reset

    @property
    def late(self) -> bool:
        """True if the first event of a tick can come from the second decision, because a threshold moved in the
        first."""
        return self.leaks or self.windowed

    # -- of a configuration ----------------------------------------------------------------------

    @abstractmethod
    def grid(self, config: ReadoutConfig) -> int:
        """Return the spacing of the reference levels in codes."""

    def lowest(self, config: ReadoutConfig) -> int:
        """Return the lowest level of the reference in codes."""
        return -config.full_scale if self.polarity else 0

    def fraction_bits(self, config: ReadoutConfig) -> int:
        """Return the number of fraction bits of the reference."""
        return config.fraction_bits if self.leaks else 0

    def closes(self, config: ReadoutConfig) -> bool:
        """Return True if every taxel has a window with more than one half-width."""
        return self.windowed and config.closing_levels_log2 > 0

    def check(self, config: ReadoutConfig) -> None:  # noqa: B027 (most encoders take every configuration)
        """Raise InputError for a configuration that this encoder does not support."""

    def extra_constants(self, config: ReadoutConfig) -> tuple[int, ...]:
        """Return the values of the fields that ``Rule`` adds to ``Constants``; a host must not change them."""
        return ()

    def rule(self, config: ReadoutConfig) -> Any:
        """Return the constants of the encoder for a configuration."""
        fraction, levels = self.fraction_bits(config), config.closing_levels_log2
        step_log2 = config.step.bit_length() - 1 + fraction
        set_by_host = (config.window_period, config.leak_shift, config.leak_period)
        steps = (1 << step_log2, 1 << step_log2 - levels)
        built = (fraction, step_log2, levels, config.most_events_per_tick)
        return self.Rule(*steps, *set_by_host, *built, *self.extra_constants(config))

    def state_dtype(self, config: ReadoutConfig) -> type[np.signedinteger[Any]]:
        """Return an integer type that can hold every number in ``ticks``."""
        return np.int32

    def half_width(self, config: ReadoutConfig, taxels: Any) -> Any:
        """Return the distance of the thresholds from the reference of every taxel, in codes."""
        return np.full(taxels.shape, config.step)

    # -- what the decoder promises ---------------------------------------------------------------

    @abstractmethod
    def error_bound(self, config: ReadoutConfig) -> tuple[float, float]:
        """Return the reconstruction error bounds (low, high): low <= x - u <= high in codes, within the slope limit."""

    @abstractmethod
    def slope_limit(self, config: ReadoutConfig) -> float:
        """Return the largest step between two samples, in codes, for which the error bound holds."""

    # -- compiled: one taxel in one clock --------------------------------------------------------
    # ``taxel`` is a record of x, u and the state. u and what ``reach`` returns are in 2**-fraction_bits codes.

    @staticmethod
    @abstractmethod
    def compare(rule: Any, taxel: Any) -> tuple[bool, bool]:
        """Return whether the sample is above the upper threshold, and whether it is below the lower threshold."""

    @staticmethod
    def reach(rule: Any, taxel: Any) -> Any:
        """Return the distance by which an event moves the reference, by default D."""
        return rule.step

    @staticmethod
    @abstractmethod
    def move(rule: Any, taxel: Any, on: bool, off: bool, tick: bool, leaks: bool) -> bool:
        """Move the reference and update the encoder state; return True if a threshold moved without an event.

        ``tick`` and ``leaks`` are true in the clock of a sample tick, and of a leak of this taxel.
        """

    @staticmethod
    def clear(rule: Any, taxel: Any) -> None:
        """Reset the encoder state of a taxel, except the reference."""
        return  # most encoders have no state

    # -- compiled: all taxels, tick by tick ------------------------------------------------------

    @staticmethod
    @abstractmethod
    def ticks(rule: Any, x: Any, state: Any, phase: Any, tick: int, counts: Any, late: Any, timed: bool) -> None:
        """Write the signed event counts of every tick, and if ``timed`` whether the first event came late.

        ``x``, ``counts`` and ``late`` have the shape (ticks, taxels), ``phase`` and the arrays of ``state`` the shape
        (taxels,). ``state`` is the reference, in units of ``grid`` or its fraction, then the encoder state. ``phase``
        is the tick of the leak within its period, in rising order; ``tick`` counts from reset.
        """
