"""Write docs/reference/commands.md from the ``--help`` of every command: ``python docs/commands.py``."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import typer

PACKAGES = ("model", "rtl", "flow", "cocotb_tests", "snn")
PAGE = Path(__file__).parent / "reference" / "commands.md"
WIDTH = 100
HEAD = """# Commands

Made from the commands' own `--help` by `python docs/commands.py`. Run them with `.venv/bin/python`; `make help` lists
the targets that do it for you. A wrong option or file prints one line, `error:` and a sentence, and exits with code 2;
Ctrl-C exits with 130.
"""


def help_of(app: typer.Typer, package: str, name: str | None) -> str:
    """Return the help of a package's program, or of one of its commands, as it is printed."""
    group = typer.main.get_command(app)
    size = {"terminal_width": WIDTH, "max_content_width": WIDTH}
    with group.make_context(f"python -m {package}", [], resilient_parsing=True, **size) as context:
        if name is None:
            return str(group.get_help(context))
        command = group.commands[name]  # type: ignore[attr-defined]
        with command.make_context(name, [], parent=context, resilient_parsing=True, **size) as own:
            return str(command.get_help(own))


def page() -> str:
    """Return the text of the page."""
    parts = [HEAD]
    for package in PACKAGES:
        app = import_module(f"{package}.__main__").app
        names = list(typer.main.get_command(app).commands)  # type: ignore[attr-defined]
        parts.append(f"## python -m {package}\n\n{app.info.help}\n")
        for name in names:
            text = "\n".join(line.rstrip() for line in help_of(app, package, name).splitlines())
            parts.append(f"### {package} {name}\n\n```text\n{text}\n```\n")
    return "\n".join(parts)


if __name__ == "__main__":
    PAGE.write_text(page())
