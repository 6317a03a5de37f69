"""Properties of the receptive fields: rounding, saturation, and no overflow."""

from collections.abc import Callable
from typing import Any, ClassVar

from amaranth.hdl import Cat, Const, Module, Signal, signed

from eskin.model.config import ReadoutConfig
from eskin.model.encoders.fields import CHOICES, KINDS, SETTABLE, Field, fields_of, kind
from eskin.rtl.encoders.fields import Fields
from eskin.verify.proofs.checker import Checker, Promises, before, implies


def _all(config: ReadoutConfig) -> list[tuple[int, int | None, Field]]:
    """Return every taxel with each of its possible fields and their numbers."""
    if config.receptive_fields != SETTABLE:
        return [(taxel, None, field) for taxel, field in enumerate(fields_of(config))]
    named: list[tuple[int, int | None, Field]] = [
        (taxel, number, kind(name, config.rows, config.columns, taxel))
        for taxel in range(config.taxels)
        for number, name in enumerate(KINDS)
    ]
    return named + [(taxel, CHOICES.index("off"), Field(())) for taxel in range(config.taxels)]


def _any(config: ReadoutConfig, has: Callable[[Field], Any]) -> bool:
    return any(has(field) for _, _, field in _all(config))


def _gains(field: Field) -> bool:
    return len(field.taxels) > 1 << field.shift


class FieldsChecker(Checker[ReadoutConfig]):
    """Checker of the field signals of all taxels against plain sums."""

    block = Fields
    only: ClassVar = {
        "ties_to_even": lambda config: _any(config, lambda field: field.shift),
        "saturates": lambda config: _any(config, _gains),
        "own_is_the_sample": lambda config: _any(config, lambda field: len(field.taxels) == 1 and not field.shift),
        "off_is_zero": lambda config: _any(config, lambda field: not field.taxels),
    }

    def check(self, m: Module) -> Promises:
        bits, scale = self.config.sample_bits, self.config.full_scale
        parts: dict[str, list[tuple[Any, Any]]] = {name: [] for name in self.properties}
        samples = [self._code(self.sample, taxel) for taxel in range(self.config.taxels)]
        for taxel, number, field in _all(self.config):
            now = Const(1, 1) if number is None else self.choice[2 * taxel : 2 * taxel + 2] == number
            signal, total = self._code(self.signal, taxel), Signal(signed(bits + 9), name=f"total_{taxel}")
            m.d.comb += total.eq(sum((samples[one] for one in field.taxels), Const(0, signed(1))))
            one = 1 << field.shift
            error = Signal(signed(bits + 10), name=f"error_{taxel}")
            m.d.comb += error.eq((signal << field.shift) - total)
            above, below = total > (scale - 1) * one, total < -scale * one
            on_scale, tie = ~above & ~below, (error * 2 == one) | (error * 2 == -one)
            near = (error * 2 <= one) & (error * 2 >= -one)
            wraps = ((total > 0) & (signal < 0)) | ((total < 0) & (signal > 0))
            said = {
                "nearest_code": (implies(on_scale, near), on_scale & (error != 0 if field.shift else 1)),
                "no_overflow": (~wraps, total < 0),
            }
            if field.shift:
                said["ties_to_even"] = implies(on_scale & tie, ~signal[0]), on_scale & tie
            if _gains(field):
                said["saturates"] = implies(above, signal == scale - 1) & implies(below, signal == -scale), above
            if len(field.taxels) == 1 and not field.shift:
                said["own_is_the_sample"] = signal == samples[field.taxels[0]], signal < 0
            if not field.taxels:
                said["off_is_zero"] = signal == 0, samples[taxel] != 0
            for name, (holds, happens) in said.items():
                parts[name].append((implies(now, holds), now & happens))
        known = before(m, Const(1, 1), "known")  # the search needs a register
        for name, of_taxels in parts.items():
            holds, happens = zip(*of_taxels, strict=True) if of_taxels else ((), ())
            yield name, Cat(holds).all(), Cat(happens).any() & known

    def _code(self, word: Any, taxel: int) -> Any:
        bits = self.config.sample_bits
        return word[taxel * bits : (taxel + 1) * bits].as_signed()
