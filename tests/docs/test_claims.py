"""Sentences that give results say what the data say."""

from __future__ import annotations

import pytest

from docs.tables import claims
from docs.tables.claims import CLAIMS, ROOT, plain, unbound

README_FREE = {
    "1 x 1 to 64 x 64": "sizes of the array",
    "2005": "of Verilog",
    "An 8 x 8 array slides over a brick wall at 65 mm/s. Below, 6-bit": "settings",
    "0.8 GB": "size of packages",
    "Python 3.11": "version",
    "exits with 1": "exit code",
    "6 folds x 3 seeds, last epoch, 95 % intervals": "protocol",
    "textures carry 99 % of their power below 97 Hz and the model assumes 10 kHz": "published with the power model",
    "N-LCS 8 b": "name of a readout",
    "five times 640 kb/s": "data rate of the published comparison",
    "The layout of 2 x 2 taxels": "picture",
    "a fortieth of 640 kb/s": "axis of the picture",
    "435 fJ an event in most tables; at 6 b": "published",
    "in 130 and 180 nm cells": "processes",
    "open 130 nm cells": "process",
    "BioCAS 2022": "year",
    "CC0": "licence",
    "Apache-2.0": "licence",
}
"""Words of the README with numbers that are no results, each with what it is."""


@pytest.mark.parametrize("name", CLAIMS)
def test_a_claim_stands_in_its_page_as_the_data_have_it(name: str) -> None:
    page, build = CLAIMS[name]
    assert plain(build()) in plain((ROOT / page).read_text())


def test_every_number_of_the_readme_is_bound_to_data_or_no_result() -> None:
    assert unbound("README.md", set(README_FREE)) == []


def test_a_number_that_nobody_accounts_for_is_seen(monkeypatch: pytest.MonkeyPatch, tmp_path) -> None:
    (tmp_path / "README.md").write_text("It takes 3.5 nW, in `2` cells, of 12 b. See [5](6.md).")
    monkeypatch.setattr(claims, "ROOT", tmp_path)
    monkeypatch.setattr(claims, "CLAIMS", {})
    assert unbound("README.md", {"12 b"}) == ["3.5", "5"]
    with pytest.raises(ValueError, match="does not say '13 b'"):
        unbound("README.md", {"13 b"})
