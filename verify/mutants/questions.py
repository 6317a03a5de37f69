"""Select the files to mutate, and the tests and proofs for each file, by names and imports."""

import ast
import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from eskin.cocotb_tests.runner.build_cache import ROOT
from eskin.verify.proofs.plan import proofs

MOST = 6
"""Largest number of test files in addition to those named after a file; if there are more, only the named ones run."""

NO_RESULTS = {"__init__", "__main__", "figures", "board", "text", "datasheet"}
"""Folders and files that draw figures or write texts, and so do not affect results."""

COMMANDS = "tests/docs/test_made.py"
"""Test that compares the page of commands with the program."""

NO_LOGIC = {"block", "yosys", "verilog", "delivery", "gates", "ports"}
"""Files of ``rtl/`` that describe no hardware."""


@dataclass(frozen=True)
class Questions:
    """Tests and proofs for the mutants of a file."""

    tests: tuple[str, ...]  # test files
    proofs: tuple[str, ...] = ()  # blocks of ``make formal``


def mutated_files(packages: tuple[str, ...]) -> list[str]:
    """Return the files to mutate: all files with results, but only files with logic for ``rtl``."""
    paths = sorted(path.relative_to(ROOT) for package in packages for path in (ROOT / package).rglob("*.py"))
    found = [path for path in paths if not {*path.parts, path.stem} & NO_RESULTS]
    return [path.as_posix() for path in found if packages != ("rtl",) or path.stem not in NO_LOGIC]


def questions(file: str, root: Path = ROOT) -> Questions:
    """Return the tests and proofs for a file.

    Its tests are the test files with its name or that of its folder, and those that import it if these are few. A
    file of the RTL is asked the tests of the files that place it, too. So is a file without a test file of its own
    name, if these are few or there are no others. Commands are asked the test of the page of commands, too, which has
    all options with their defaults.
    """
    more = (COMMANDS,) if file.startswith("app/commands/") else ()
    return Questions((*_tests(file, root), *more), _proofs(file, root) if file.startswith("rtl/") else ())


@cache
def _tests(file: str, root: Path) -> tuple[str, ...]:
    found = _own(file, root)
    if Path(file).stem in {Path(path).stem.removeprefix("test_") for path in found}:
        users = _users(file, root) if file.startswith("rtl/") else []
        return tuple(dict.fromkeys([*found, *(test for user in users for test in _own(user, root))]))
    more = tuple(dict.fromkeys([*found, *(test for user in _users(file, root) for test in _tests(user, root))]))
    return more if len(more) <= MOST or not found or file.startswith("rtl/") else tuple(found)


def _own(file: str, root: Path) -> list[str]:
    """Return the tests that are named after a file or its folder, and few tests that import the file."""
    package, *names = Path(file).with_suffix("").parts
    imports = _imports(root)
    tests = [path for path in imports if Path(path).stem.startswith("test_")]
    near = [path for path in tests if path.startswith((f"tests/{package}/", "cocotb_tests/"))]
    named = [path for path in near if Path(path).stem in {f"test_{name}" for name in (package, *names)}]
    importing = [path for path in tests if _module(file) in imports[path] and path not in named]
    called = [path for path in tests if _calls(root, path) & _commands(root, file)] if package == "app" else []
    if len(called) <= MOST:
        importing = list(dict.fromkeys([*importing, *(path for path in called if path not in named)]))
    return named + importing if len(importing) <= MOST else named or importing


@cache
def _commands(root: Path, file: str) -> set[str]:
    """Return the command names that a file may implement."""
    return set(re.findall(r"^def ([a-z][\w-]*)\(", (root / file).read_text().replace("_", "-"), re.MULTILINE))


@cache
def _calls(root: Path, test: str) -> set[str]:
    """Return the words in a test file that may be command names."""
    return set(re.findall(r'"([a-z][a-z0-9-]+)"', (root / test).read_text()))


@cache
def _proofs(file: str, root: Path) -> tuple[str, ...]:
    """Return the proof blocks named after a file, or after the files that import it."""
    names = Path(file).with_suffix("").parts
    blocks = dict.fromkeys(proof.block for proof in proofs())
    own = [block for block in blocks if any(block == name or block.startswith(f"{name}_") for name in names)]
    return tuple(own or dict.fromkeys(block for user in _users(file, root) for block in _proofs(user, root)))


def _users(file: str, root: Path) -> list[str]:
    """Return the files of the same package that import a file, except files that only write texts."""
    package, imports = file.partition("/")[0], _imports(root)
    users = [path for path in imports if path.startswith(f"{package}/") and _module(file) in imports[path]]
    return [user for user in users if Path(user).stem not in NO_LOGIC]


def _module(file: str) -> str:
    return ".".join(["eskin", *Path(file).with_suffix("").parts])


@cache
def _imports(root: Path) -> dict[str, set[str]]:
    found: dict[str, set[str]] = {}
    for path in sorted(root.rglob("*.py")):
        parts = path.relative_to(root).parts
        if parts[0].startswith(".") or {"out", "build"} & set(parts):
            continue
        wanted: set[str] = set()
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                wanted |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                wanted |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        found[path.relative_to(root).as_posix()] = wanted
    return found
