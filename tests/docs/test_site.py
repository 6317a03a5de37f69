"""The site: built with warnings as errors; links and anchors lead somewhere; nothing comes from other hosts."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

ROOT = Path(__file__).parents[2]
ASSETS = {"img": "src", "script": "src", "link": "href", "source": "src", "iframe": "src"}
EXTERNAL_LINK = ("canonical",)
"""Kinds of <link> that name an address without loading it."""


class Page(HTMLParser):
    """What a page links to (``links``), loads (``assets``), and the anchors it has (``ids``)."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.assets: list[str] = []
        self.ids: set[str] = set()
        self.feed(path.read_text())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        self.ids |= {values[name] for name in ("id", "name") if name in values}
        if tag == "a" and "href" in values:
            self.links.append(values["href"])
        elif (name := ASSETS.get(tag)) in values and values.get("rel") not in EXTERNAL_LINK:
            self.assets.append(values[str(name)])


def broken(site: Path) -> list[str]:
    """Return, for every page of a site, the links, anchors and assets that lead nowhere or to other hosts."""
    pages = {path: Page(path) for path in sorted(site.rglob("*.html"))}
    found = []
    for path, page in pages.items():
        for kind, references in (("link", page.links), ("asset", page.assets)):
            for reference in references:
                parts = urlsplit(reference)
                if parts.scheme or parts.netloc:
                    if kind == "asset" and parts.scheme != "data":
                        found.append(f"{path.name}: loads {reference}")
                    continue
                base = site if parts.path.startswith("/") else path.parent
                target = (base / unquote(parts.path).lstrip("/")).resolve() if parts.path else path
                target = target / "index.html" if target.is_dir() else target
                if not target.is_file():
                    found.append(f"{path.name}: {kind} {reference} leads nowhere")
                elif parts.fragment and target in pages and unquote(parts.fragment) not in pages[target].ids:
                    found.append(f"{path.name}: {reference} has no such anchor")
    for style in site.rglob("*.css"):
        found += [f"{style.name}: loads {url}" for url in re.findall(r"url\(['\"]?(https?:[^)]*)\)", style.read_text())]
    return found


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if not importlib.util.find_spec("mkdocs"):
        assert not os.environ.get("CI"), "the gate builds the site: pip install -c constraints.txt -e '.[docs]'"
        pytest.skip("the site's tools are not installed: pip install -c constraints.txt -e '.[docs]'")
    out = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(out)],
        cwd=ROOT,
        env=os.environ | {"NO_MKDOCS_2_WARNING": "1", "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return out


def test_the_site_has_every_room_search_and_the_notebook_no_broken_link_and_nothing_of_other_hosts(site: Path) -> None:
    assert len(list(site.rglob("*.html"))) > 30
    index = (site / "search" / "search_index.json").read_text()
    for name in ("ReadoutConfig", "model.taxel", "rtl.arbiter", "snn.kernels.layer", "cocotb_tests.bench.reference"):
        assert name in index
    assert (site / "tutorial.ipynb").is_file()
    assert not broken(site)


def test_a_broken_link_is_found(tmp_path: Path) -> None:
    (tmp_path / "b.html").write_text('<h1 id="here">b</h1>')
    (tmp_path / "a.html").write_text(
        '<a href="b.html#here">1</a> <a href="b.html#gone">2</a> <a href="c.html">3</a> <a href="https://example.org">4</a>'
        '<img src="https://example.org/a.png"><link rel="canonical" href="https://example.org">'
    )
    assert broken(tmp_path) == [
        "a.html: b.html#gone has no such anchor",
        "a.html: link c.html leads nowhere",
        "a.html: loads https://example.org/a.png",
    ]


@pytest.mark.parametrize("name", ["README.md", "CONTRIBUTING.md", "CHANGELOG.md"])
def test_the_files_at_the_top_link_to_files(name: str) -> None:
    targets = re.findall(r"\]\((?!https?:)([^)#]+)", (ROOT / name).read_text())
    assert targets
    assert not [target for target in targets if not (ROOT / target).exists()]
