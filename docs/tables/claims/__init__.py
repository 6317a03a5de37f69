"""Sentences of the documents that give results: each is written here from the data, and must stand in its page.

A claim is a function that yields words of its page, as long as is needed to know them there. What stands in a page and
is neither in a table, nor in a claim, nor code, nor named in ``tests/docs/free.toml`` as no result, is found by a test.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from functools import cache

from docs.tables.written import ROOT

Build = Callable[[], Iterator[str]]
CLAIMS: dict[str, tuple[str, Build]] = {}
"""Name of a claim: its page, and what makes its words."""

CODE = re.compile(r"<!-- table .*?<!-- end -->|^```.*?^```|^    (?![ |]).*?$|`[^`]*`", re.DOTALL | re.MULTILINE)
LINK = re.compile(r"\]\([^)]*\)|<a id=[^>]*>")
ITEM = re.compile(r"^ *\d+\. ", re.MULTILINE)
NUMBER = re.compile(r"(?<![\w.,])(?:(?<!\w)[-+])?\d(?:[\d.,]*\d)?")


def claim(page: str) -> Callable[[Build], Build]:
    """Register a claim of a page, by its path from the top of the project."""

    def register(build: Build) -> Build:
        CLAIMS[f"{build.__module__.rpartition('.')[2]}.{build.__name__}"] = page, build
        return build

    return register


def plain(text: str) -> str:
    """Return what a page says, with one blank between two words."""
    return " ".join(text.split())


@cache
def place(words: str) -> re.Pattern[str]:
    """Return what finds words in a plain text, not within a longer number; " ... " is whatever stands between."""
    pattern = re.escape(words).replace(re.escape(" ... "), " .*? ")
    return re.compile(rf"(?<!\d)(?<!\d[.,]){pattern}(?![.,]?\d)")


@cache
def words_of(build: Build) -> tuple[str, ...]:
    """Return what a claim says, with one blank between two words."""
    return tuple(map(plain, build()))


def said(page: str) -> list[str]:
    """Return all that the claims of a page say."""
    return [words for where, build in CLAIMS.values() if where == page for words in words_of(build)]


def unbound(page: str, free: set[str], patterns: Iterable[str] = ()) -> list[str]:
    """Return the numbers of a page that neither a table nor a claim nor the list of what is no result accounts for.

    Parameters
    ----------
    page : str
        Its path from the top of the project.
    free : set of str
        Words with numbers that are no results: sizes, settings, names; " ... " in them is whatever stands between.
    patterns : iterable of str
        Regular expressions of words that can be no results on any page.

    Raises
    ------
    ValueError
        If one of these words is not in the page.
    """
    text = _prose((ROOT / page).read_text())
    for words in sorted(map(_prose, said(page)), key=len, reverse=True):
        text = place(words).sub(" _ ", text)
    for words in sorted(free, key=len, reverse=True):
        text, found = place(words).subn(" _ ", text)
        if not found:
            raise ValueError(f"{page} does not say {words!r}, which tests/docs/free.toml leaves out")
    for pattern in patterns:
        text = re.sub(pattern, " _ ", text)
    return NUMBER.findall(text)


def _prose(text: str) -> str:
    """Return a text without tables, code and the addresses of links."""
    return plain(ITEM.sub("", LINK.sub("]", CODE.sub("_", text))))


def mended(page: str, text: str) -> str:
    """Return a page with the numbers of its claims as the data have them; what differs in words stays.

    A claim that is not there is looked for with any numbers in it; where it stands once so, they are written anew.
    """
    for words in said(page):
        if place(words).search(plain(text)):
            continue
        parts = [r"\s+".join(map(re.escape, part.split(" "))) for part in NUMBER.split(words)]
        places = list(re.finditer(f"({NUMBER.pattern})".join(parts), text))
        if len(places) == 1:
            (old,) = places
            numbers = iter(NUMBER.findall(words))
            new, at = "", old.start()
            for group in range(1, len(parts)):
                new += text[at : old.start(group)] + next(numbers)
                at = old.end(group)
            text = text[: old.start()] + new + text[at:]
    return text
