"""Format numbers for people: three digits and a unit with a prefix."""

import math

PREFIXES = ("a", "f", "p", "n", "u", "m", "", "k", "M", "G", "T")


def with_unit(value: float, unit: str) -> str:
    """Return a value with its unit as text: 26.9 mW, 80.2 uV, 1.2 Mbit/s."""
    if value == 0 or not math.isfinite(value):
        return f"{value:g} {unit}"
    power = len(PREFIXES) - 1
    while power and abs(value) < 0.9995 * 1000.0 ** (power - 6):  # a value that rounds to 1000 is 1 in the next unit
        power -= 1
    return f"{plain(value / 1000.0 ** (power - 6))} {PREFIXES[power]}{unit}"


def counted(number: int, noun: str) -> str:
    """Return a number with its noun, in the plural unless the number is 1: 3 recordings."""
    return f"{number} {noun}{'s' * (number != 1)}"


def plain(value: float) -> str:
    """Return a number as text, for example 0.000123, 3.66 or 12,345.

    The text has three significant digits. Numbers from 1000 on are rounded to whole numbers.
    """
    return f"{value:,.0f}" if abs(value) >= 999.5 else f"{value:.3g}"
