"""MkDocs hook that generates pages: commands, an API page for every module, a list of modules, the tutorial notebook.

The API pages are made from the folders, so a file that moves or comes anew is on the site without an entry here.
"""

import ast
import sys
from pathlib import Path
from typing import Any

import jupytext
import typer
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

from docs.tutorial_page import source
from eskin.app.catalogue import GROUPS, words_of
from eskin.app.cli import Commands, app

ROOT = Path(__file__).parents[1]
FIRST = (
    "eskin/api.py",
    "model/config.py",
    "rtl/readout.py",
    "rtl/verilog.py",
    "model/readout.py",
    "model/taxel.py",
    "model/events/recording.py",
    "skin/recordings/folder.py",
    "snn/data/record.py",
    "snn/train.py",
    "power/equations.py",
)
"""Modules that users of a part call, in the order of the list."""

PACKAGES = ("model", "rtl", "skin", "power", "cocotb_tests", "analog", "snn", "board", "flow", "verify", "base")
OUTSIDE = {"CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md", "studies/README.md": "studies.md"}
"""Pages outside this folder, with their names on the site."""
API = "reference/api"


def rooms() -> dict[str, list[Path]]:
    """Return the public modules of every folder, keyed by dotted name such as ``model.events``."""
    found: dict[str, list[Path]] = {}
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            room = path.parent.relative_to(ROOT).parts
            if not path.name.startswith(("_", "test_", "conftest")) and "commands" not in room:
                found.setdefault(".".join(room), []).append(path)
    return found


def imported_as(path: Path) -> str:
    """Return the import name of a module."""
    place = path.relative_to(ROOT)
    return "eskin" if place.parts[0] == "eskin" else ".".join(("eskin", *place.with_suffix("").parts))


def row_of(path: Path) -> str:
    """Return a table row for a module: link to its page, classes, and first sentence."""
    tree, name = ast.parse(path.read_text()), imported_as(path)
    classes = [node.name for node in tree.body if isinstance(node, ast.ClassDef) and not node.name.startswith("_")]
    shown = ", ".join(f"`{found}`" for found in classes[:4]) + (", ..." if len(classes) > 4 else "")
    sentence = " ".join((ast.get_docstring(tree) or "").split("\n\n")[0].split()).replace("|", "\\|")
    return f"| [{name}]({name}.md) | {shown} | {sentence} |"


def list_of_modules() -> str:
    """Return the page that lists all modules, those for users first."""
    head = "| module | classes | what it is |\n|---|---|---|\n"
    called = [ROOT / place for place in FIRST]
    parts = ["# Python modules", "## What users call", head + "\n".join(map(row_of, called))]
    for room, paths in rooms().items():
        rest = [path for path in paths if path not in called]
        if rest:
            parts += [f"## eskin.{room}", head + "\n".join(map(row_of, rest))]
    return "\n\n".join(parts) + "\n"


def list_of_commands() -> str:
    """Return the page that shows the ``--help`` text of every command."""
    size: dict[str, Any] = {"terminal_width": 100, "max_content_width": 100, "resilient_parsing": True}
    parts = ["# Commands", "Every command of `eskin` is also a make target. The text of each is that of `--help`."]
    with typer.main.get_command(app).make_context("eskin", [], **size) as above:
        for heading, names in GROUPS.items():
            parts.append(f"## {heading}")
            for name, command in Commands(names).items():
                words = " ".join(words_of(name))
                with command.make_context(words, [], parent=above, **size) as context:
                    text = "\n".join(line.rstrip() for line in command.get_help(context).splitlines())
                parts += [f"### eskin {words}", f"```text\n{text}\n```"]
    return "\n\n".join(parts) + "\n"


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Add the list of modules to the navigation, at the end of Reference."""
    (reference,) = (entry["Reference"] for entry in config.nav or [] if "Reference" in entry)
    reference.append({"Python modules": f"{API}/index.md"})
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages to the site."""
    files.append(File.generated(config, "reference/commands.md", content=list_of_commands()))
    files.append(File.generated(config, f"{API}/index.md", content=list_of_modules()))
    for path in [ROOT / FIRST[0], *(path for paths in rooms().values() for path in paths)]:
        name = imported_as(path)
        module = "eskin.api" if name == "eskin" else name
        head = "---\nsearch:\n  boost: 0.2\n---\n"  # search lists guides first
        text = f"{head}# {name}\n\n`{path.relative_to(ROOT)}`\n\n::: {module}\n"
        files.append(File.generated(config, f"{API}/{name}.md", content=text))
    for place, name in OUTSIDE.items():
        up = "../" * place.count("/")
        text = (ROOT / place).read_text().replace(f"]({up}docs/", "](")
        for other, page in OUTSIDE.items():
            text = text.replace(f"]({other}", f"]({page}")
        files.append(File.generated(config, name, content=text))
    notebook = jupytext.reads(source(), fmt="md")
    notebook.metadata["kernelspec"] = {"display_name": "Python 3", "language": "python", "name": "python3"}
    files.append(File.generated(config, "tutorial.ipynb", content=jupytext.writes(notebook, fmt="ipynb")))
    return files


def on_page_markdown(markdown: str, page: Page, **_: object) -> str:
    """Add a link to the notebook above the tutorial."""
    if page.file.src_uri != "tutorial.md":
        return markdown
    title, _, rest = markdown.partition("\n")
    return f"{title}\n\n[This page as a notebook](tutorial.ipynb)\n{rest}"


READ: list[str] = []
"""Pages that have been read so far; reading a module takes most of the time."""


def on_page_content(html: str, page: Page, files: Files, **_: object) -> str:
    """Report the progress of page generation on standard error."""
    READ.append(page.url)
    total = len(files.documentation_pages())
    if len(READ) % 100 == 0 or len(READ) == total:
        print(f"{len(READ)} of {total} pages", file=sys.stderr, flush=True)
    return html
