"""The command reference from ``--help``, and the register page from the register description."""

import dataclasses

import typer

from docs.tables.write import Rows
from eskin.app.catalogue import GROUPS, words_of
from eskin.app.cli import Commands, app
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.config import ReadoutConfig
from eskin.model.registers.export import page_of_all

SIZE = {"terminal_width": 100, "max_content_width": 100}


def commands() -> None:
    """Print the ``--help`` text of every command."""
    group = typer.main.get_command(app)
    print()
    with group.make_context("eskin", [], resilient_parsing=True, **SIZE) as above:
        for heading, names in GROUPS.items():
            print(f"## {heading}\n")
            for name, command in Commands(names).items():
                words = " ".join(words_of(name))
                with command.make_context(words, [], parent=above, resilient_parsing=True, **SIZE) as context:
                    text = "\n".join(line.rstrip() for line in command.get_help(context).splitlines())
                print(f"### eskin {words}\n\n```text\n{text}\n```\n")


def registers() -> None:
    """Print every register that any encoder has, with the values for the default array."""
    print(f"\n{page_of_all(ReadoutConfig(registers='spi'))}")


def classifier_fields() -> Rows:
    """Yield every field of the classifier's configuration."""
    for field in dataclasses.fields(ClassifierConfig):
        unit = f" ({field.metadata['unit']})" if field.metadata["unit"] else ""
        default = "none" if field.default is None else str(field.default)
        yield [f"`{field.name}`", default, field.metadata["meaning"] + unit]
