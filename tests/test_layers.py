"""Test the layers: one-way imports, parsing and printing only in app, limits on files and folders."""

import ast
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

pytestmark = pytest.mark.quick

ROOMS = ("base", "model", "rtl", "skin", "power", "cocotb_tests", "analog", "snn", "board", "flow", "verify", "app")
"""The packages from the ground up: each imports only from itself and from those before it."""

ALONE = {
    "rtl": {"skin", "power"},
    "snn": {"rtl", "cocotb_tests", "analog"},
    "board": {"cocotb_tests", "analog", "snn"},
    "flow": {"snn"},
}
"""Packages before a package that it must not import all the same."""

MAX_FILES = 13
MAX_LINES_OF_A_FUNCTION = 60
MAX_PARAMETERS = 8

LONG = {
    "eskin.model.readout._loop": "arrays handed on to a part of the loop would cost a third of its speed",
}
"""Functions above 60 lines, and parameter lists above eight, each with the reason why."""


def files() -> list[Path]:
    return sorted([*(path for room in ROOMS for path in (ROOT / room).rglob("*.py")), *(ROOT / "eskin").glob("*.py")])


def name_of(path: Path) -> str:
    inside = path.relative_to(ROOT / "eskin" if on_top(path) else ROOT)
    return ".".join(("eskin", *inside.with_suffix("").parts)).removesuffix(".__init__")


def on_top(path: Path) -> bool:
    return path.parent == ROOT / "eskin"


@cache
def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text())


def statements(path: Path, at_run_time: bool = False) -> list[ast.AST]:
    """Return the statements of a file; ``at_run_time`` leaves out those for type checkers."""
    found: list[ast.AST] = [tree(path)]
    for node in found:
        if not (at_run_time and isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"):
            inner = (ast.stmt, ast.excepthandler, ast.match_case)
            found += (child for child in ast.iter_child_nodes(node) if isinstance(child, inner))
    return found


@cache
def imports() -> dict[str, set[str]]:
    """Return the project modules that each module imports."""
    modules = {name_of(path): path for path in files()}
    found: dict[str, set[str]] = {}
    for name, path in modules.items():
        wanted: set[str] = set()
        for node in statements(path, at_run_time=True):
            if isinstance(node, ast.ImportFrom):
                assert node.module is not None, f"{path} has a relative import"
                assert not node.level, f"{path} has a relative import"
                wanted |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
            elif isinstance(node, ast.Import):
                wanted |= {alias.name for alias in node.names}
        # A package stands for its __init__ alone, which imports nothing here.
        found[name] = {m for m in wanted & set(modules) if modules[m].name != "__init__.py"} - {name}
    return found


def test_rooms_import_from_below_only() -> None:
    assert len(imports()) > 100
    for module, others in imports().items():
        room = module.split(".")[1] if "." in module else ""
        if room not in ROOMS:
            continue  # on top of all
        below = set(ROOMS[: ROOMS.index(room) + 1]) - ALONE.get(room, set())
        upward = {other for other in others if other.split(".")[1] not in below}
        assert not upward, f"{module} imports {sorted(upward)}"


def test_no_room_imports_a_study() -> None:
    for path in files():
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.Import | ast.ImportFrom):
                names = {alias.name for alias in node.names} | {getattr(node, "module", None) or ""}
                assert "studies" not in {name.partition(".")[0] for name in names}, f"{path}:{node.lineno}"


def test_no_two_folders_of_a_room_need_each_other() -> None:
    graph: dict[str, set[str]] = {}
    for module, others in imports().items():
        place = ".".join(module.split(".")[:3])
        graph.setdefault(place, set()).update(".".join(other.split(".")[:3]) for other in others)
    try:
        TopologicalSorter({place: others - {place} for place, others in graph.items()}).prepare()
        TopologicalSorter(imports()).prepare()  # nor two files of a folder
    except CycleError as circle:
        pytest.fail(f"these import each other: {circle.args[1]}")


def test_figures_and_commands_stand_on_top() -> None:
    for module, others in imports().items():
        if {"figures", "app", "api"} & set(module.split(".")) or module.startswith("eskin.cocotb_tests"):
            continue  # make sim leaves a picture, and eskin.plot returns one
        figures = {other for other in others if "figures" in other.split(".") and not other.startswith("eskin.base.")}
        assert not figures, f"{module} imports {sorted(figures)}"


def test_only_the_app_parses_and_prints() -> None:
    for path in files():
        if path.relative_to(ROOT).parts[0] == "app" or path == ROOT / "base" / "progress.py":
            continue
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.Import | ast.ImportFrom):
                names = {alias.name for alias in node.names} | {getattr(node, "module", None) or ""}
                assert not {name.partition(".")[0] for name in names} & {"typer", "rich"}, f"{path}:{node.lineno}"
            elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                assert node.func.id != "print", f"{path}:{node.lineno} prints"


def test_folders_stay_small() -> None:
    for folder in {path.parent for path in files()}:
        modules = [path.name for path in folder.glob("*.py") if not path.name.startswith(("__", "test_", "conftest"))]
        assert len(modules) <= MAX_FILES, f"{folder} has {len(modules)} files"


def test_functions_stay_short() -> None:
    known = set()
    for path in files():
        for node in statements(path):
            if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                continue
            name = f"{name_of(path)}.{node.name}"
            known.add(name)
            lines = (node.end_lineno or 0) - node.body[0].lineno + 1  # without signature and decorators
            if ast.get_docstring(node) and len(node.body) > 1:
                lines = (node.end_lineno or 0) - node.body[1].lineno + 1
            parameters = node.args.posonlyargs + node.args.args + node.args.kwonlyargs
            count = sum(argument.arg not in ("self", "cls", "ctx") for argument in parameters)
            command = "commands" in path.parts
            if name not in LONG:
                assert lines <= MAX_LINES_OF_A_FUNCTION, f"{name} has {lines} lines"
                assert command or count <= MAX_PARAMETERS, f"{name} has {count} parameters"
    assert set(LONG) <= known, "every exception is needed"


def test_packages_import_nothing_by_themselves() -> None:
    for path in files():
        if path.name == "__init__.py":
            assert not any(isinstance(node, ast.Import | ast.ImportFrom) for node in statements(path)) or (
                path == ROOT / "model" / "__init__.py" or on_top(path)  # tests/test_api.py holds that one
            ), path
