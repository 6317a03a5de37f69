"""Test the site: mkdocs builds it without warnings, and it loads nothing from other hosts."""

import importlib.util
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LOADED = re.compile(r"<(?:img|script|iframe|source|link)\b[^>]*\b(?:src|href)=\"https?:[^>]*|url\(['\"]?https?:[^)]*")


def loaded_from_elsewhere(site: Path) -> list[str]:
    """Return all external resources that a site loads."""
    files = [path for path in sorted(site.rglob("*")) if path.suffix in (".html", ".css")]
    found = [f"{path.name}: {text}" for path in files for text in LOADED.findall(path.read_text())]
    return [text for text in found if 'rel="canonical"' not in text]


def test_the_site_has_every_room_search_and_the_notebook_and_loads_nothing_from_other_hosts(tmp_path: Path) -> None:
    if not importlib.util.find_spec("mkdocs"):
        assert not os.environ.get("CI"), "the gate builds the site: pip install -c constraints.txt -e '.[docs]'"
        pytest.skip("the site's tools are not installed: pip install -c constraints.txt -e '.[docs]'")
    site = tmp_path / "site"
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(site)],
        cwd=ROOT,
        env=os.environ | {"NO_MKDOCS_2_WARNING": "1", "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert len(list(site.rglob("*.html"))) > 30
    index = (site / "search" / "search_index.json").read_text()
    for name in (
        "ReadoutConfig",
        "eskin.model.taxel",
        "eskin.rtl.arbiter",
        "eskin.snn.kernels.layer",
        "eskin.cocotb_tests.independent.taxel",
    ):
        assert name in index
    notebook = json.loads((site / "tutorial.ipynb").read_text())
    kinds = [cell["cell_type"] for cell in notebook["cells"]]
    assert kinds.count("code") == (ROOT / "docs" / "tutorial.md").read_text().count("```python\n") > 5
    assert set(kinds) == {"code", "markdown"}
    assert notebook["metadata"]["kernelspec"]["name"] == "python3"
    assert not loaded_from_elsewhere(site)
    # Search: "csv" finds file names, and a page of file:// gets the index and a stand-in for the worker as scripts.
    separator = json.loads(index)["config"]["separator"]
    assert "csv" in re.split(separator, "my_skin/press/0.csv")
    assert "arbiter" in re.split(separator, "eskin.rtl.arbiter")
    assert (site / "search" / "search_index.js").read_text().startswith("var __index = {")
    assert 'src="assets/iframe-worker.js"' in (site / "index.html").read_text()
    assert (site / "assets" / "iframe-worker.js").is_file()
    commands = (site / "reference" / "commands.html").read_text()
    assert 'id="eskin-encode"' in commands
    assert "--sample-rate" in commands
    # Reference: a page for each module, behind one list that begins with what users import.
    listed = re.findall(r'href="(eskin[\w.]*)\.html"', (site / "reference" / "api" / "index.html").read_text())
    assert listed[:2] == ["eskin", "eskin.model.config"]
    assert {"eskin.rtl.arbiter", "eskin.model.arbiter"} <= set(listed)
    assert all((site / "reference" / "api" / f"{name}.html").is_file() for name in listed)


def test_a_picture_of_another_host_is_found(tmp_path: Path) -> None:
    (tmp_path / "a.html").write_text(
        '<a href="https://example.org">4</a><img alt="" src="https://example.org/a.png">'
        '<link rel="canonical" href="https://example.org">'
    )
    assert loaded_from_elsewhere(tmp_path) == ['a.html: <img alt="" src="https://example.org/a.png"']


@pytest.mark.parametrize("name", ["README.md", "CONTRIBUTING.md", "CHANGELOG.md"])
def test_the_files_at_the_top_link_to_files(name: str) -> None:
    targets = re.findall(r"\]\((?!https?:)([^)#]+)", (ROOT / name).read_text())
    assert targets
    assert not [target for target in targets if not (ROOT / target).exists()]
