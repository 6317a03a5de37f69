"""Hook of the site: the pages that have no file in docs/. A reference page for every room of the packages,
from the docstrings of its modules; the files at the top that a reader of the site needs; the tutorial as a notebook.

The pages are made from the folders, so a file that moves or comes anew is on the site without an entry here.
Command lines have no page: docs/reference/commands.md is theirs.
"""

from __future__ import annotations

from pathlib import Path

import jupytext
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[1]
PACKAGES = ("model", "rtl", "skin", "power", "cocotb_tests", "snn", "board", "flow", "verify", "base")
COMMANDS = ("commands",)
TOP = "eskin"
"""The package itself: what a user calls."""
AT_THE_TOP = ("CONTRIBUTING.md", "CHANGELOG.md")


def rooms() -> dict[str, list[str]]:
    """Return the public modules of every room, by the room's dotted name: ``model.events`` and so on."""
    found: dict[str, list[str]] = {TOP: ["api"]}
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            room = path.parent.relative_to(ROOT).parts
            if not path.name.startswith(("_", "test_", "conftest")) and not set(room) & set(COMMANDS):
                found.setdefault(".".join(room), []).append(path.stem)
    return found


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Add the pages to the navigation, below Reference."""
    pages: dict[str, list[dict[str, str]]] = {}
    for room in rooms():
        pages.setdefault(room.partition(".")[0], []).append({room: f"reference/api/{room}.md"})
    (reference,) = (entry["Reference"] for entry in config.nav or [] if "Reference" in entry)
    reference += [{package: entries} for package, entries in pages.items()]
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages themselves."""
    for room, modules in rooms().items():
        folder, package = "/".join(room.split(".")), TOP if room == TOP else f"{TOP}.{room}"
        text = f"# {room}\n\nFiles of `{folder}/`.\n\n" + "\n\n".join(f"::: {package}.{module}" for module in modules)
        files.append(File.generated(config, f"reference/api/{room}.md", content=text + "\n"))
    for name in AT_THE_TOP:
        text = (ROOT / name).read_text().replace("](docs/", "](")
        for other in AT_THE_TOP:
            text = text.replace(f"]({other}", f"]({other.lower()}")
        files.append(File.generated(config, name.lower(), content=text))
    notebook = jupytext.writes(jupytext.read(ROOT / "docs" / "tutorial.py"), fmt="ipynb")
    files.append(File.generated(config, "tutorial.ipynb", content=notebook))
    return files


def on_page_markdown(markdown: str, page: Page, **_: object) -> str:
    """Offer the notebook above the tutorial."""
    if page.file.src_uri != "tutorial.md":
        return markdown
    title, _, rest = markdown.partition("\n")
    return f"{title}\n\n[This page as a notebook](tutorial.ipynb)\n{rest}"
