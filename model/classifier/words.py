"""Signed integers that are packed in a word, the first in the lowest bits."""

from collections.abc import Iterable


def packed(values: Iterable[int], bits: int) -> int:
    """Return the word of signed integers that take ``bits`` each; higher bits of a value are dropped."""
    mask = (1 << bits) - 1
    return sum((int(value) & mask) << place * bits for place, value in enumerate(values))


def unpacked(word: int, count: int, bits: int) -> list[int]:
    """Return the ``count`` signed integers in a word that take ``bits`` each."""
    parts = [word >> place * bits & (1 << bits) - 1 for place in range(count)]
    return [part - (part >> bits - 1 << bits) for part in parts]
