"""Documents that are made from data or from the commands say what these say."""

from __future__ import annotations

import importlib.util
import json
import re
import sys
from pathlib import Path
from types import ModuleType

import pytest

from docs.tables import rates, written
from docs.tables.__main__ import PAGES, filled

ROOT = Path(__file__).parents[2]


def load(path: str) -> ModuleType:
    """Return a script of ``docs/`` as a module; the folder is no package."""
    spec = importlib.util.spec_from_file_location(f"docs_{Path(path).stem}", ROOT / path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_tables_are_those_of_the_data(page: Path) -> None:
    text = page.read_text()
    assert filled(text) == text, "run python -m docs.tables"


def test_every_table_stands_somewhere() -> None:
    shown = {name for page in PAGES for _, name, _ in written.BLOCK.findall(page.read_text())}
    assert shown == set(written.TABLES)


def test_the_rates_are_those_that_the_power_model_reads() -> None:
    for point in rates.rates():
        stored = rates.stored_hz(point["encoding"], point["resolution"])
        assert stored == pytest.approx(point["here_hz"], rel=1e-4)


def test_the_command_reference_is_what_help_prints() -> None:
    commands = load("docs/commands.py")
    assert commands.PAGE.read_text() == commands.page(), "run python docs/commands.py"


def test_the_page_of_the_registers_is_that_of_their_description() -> None:
    registers = load("docs/registers.py")
    assert registers.PAGE.read_text() == registers.page(), "run python docs/registers.py"


def test_the_pictures_of_the_architecture_are_those_of_the_code() -> None:
    architecture = load("docs/figures/architecture.py")
    assert json.loads(architecture.DATA.read_text()) == architecture.data(), "run python docs/figures/architecture.py"


def test_every_file_that_the_documents_name_is_there() -> None:
    named = re.compile(r"`((?:model|rtl|flow|snn|cocotb_tests|tests|benchmarks|docs)/[\w./-]*)`")
    for page in [*PAGES, ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"]:
        for name in named.findall(page.read_text()):
            assert (ROOT / name).exists(), f"{page.name} names {name}"
