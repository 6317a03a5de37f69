"""Receptive fields computed with exact fractions."""

from collections.abc import Sequence
from fractions import Fraction

from eskin.cocotb_tests.independent.settings import Settings


def field_of(settings: Settings, row: int, column: int) -> tuple[list[tuple[int, int]], int]:
    """Return the taxels (row, column) of a field with repetition, and the divisor of their sum."""
    here = (row, column)
    if settings.receptive_fields in ("own", "settable"):  # which is the own one after a reset
        return [here], 1
    if isinstance(settings.receptive_fields, str):
        four = []
        for down, right in ((-1, 0), (1, 0), (0, -1), (0, 1)):
            there = (row + down, column + right)
            inside = 0 <= there[0] < settings.rows and 0 <= there[1] < settings.columns
            four.append(there if inside else here)
        return {"neighbours": (four, 4), "both": (four + 4 * [here], 8)}[settings.receptive_fields]
    listed = settings.receptive_fields[row * settings.columns + column]
    return [divmod(taxel, settings.columns) for taxel in listed["taxels"]], 2 ** listed["shift"]


def on(settings: Settings) -> list[bool]:
    """Return for every taxel whether it has a field."""
    return [bool(field_of(settings, r, c)[0]) for r in range(settings.rows) for c in range(settings.columns)]


def signals(settings: Settings, sample: Sequence[int]) -> list[int]:
    """Return the inputs of the encoders for the codes of all taxels."""
    room = 4 if settings.frontend == "analog" else 1
    seen = []
    for r in range(settings.rows):
        for c in range(settings.columns):
            taxels, divisor = field_of(settings, r, c)
            exact = Fraction(sum(int(sample[y * settings.columns + x]) for y, x in taxels), divisor)
            below = exact.numerator // exact.denominator
            rest = exact - below
            code = below + (below % 2 if rest == Fraction(1, 2) else rest > Fraction(1, 2))
            seen.append(max(room * settings.bottom, min(room * (settings.top + 1) - 1, code)))
    return seen
