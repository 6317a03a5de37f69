"""The house holds: imports run one way, commands alone parse and print, no folder or file grows without end."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

LAYERS = {
    "model": (
        "errors",
        "files",
        "crew",
        "config",
        "events.address window decay arbiter link taxel_kernels frame_config frame_words registers tiles.config",
        "taxel readout frame classifier",
        "events textures tiles registers.host classifier.chip",
        "recordings board",
        "figures",
        "power",
        "report",
        "cli",
        "commands",
        "__main__",
    ),
    "rtl": (
        "text.expression",
        "text.fold",
        "block logic yosys",
        "window decay taxel arbiter link frame classifier registers",
        "readout classifier.chip tiles",
        "verilog text.testbench board",
        "delivery",
        "datasheet gates",
        "power",
        "__main__",
    ),
    "flow": (
        "formal.checker formal.mutants",
        "formal.blocks formal.bench",
        "formal.plan formal.engine",
        "formal.run formal.bind",
        "formal.report cross mutants",
        "coverage.constructs coverage.points.point",
        "coverage.points.readout coverage.points.registers coverage.points.blocks coverage.points.classifier "
        "coverage.points.board",
        "coverage.points.every",
        "coverage.bench coverage.stimuli coverage.waivers",
        "coverage.boards.host",
        "coverage.boards.script coverage.boards.play",
        "coverage.plan",
        "coverage.run",
        "faults.gates faults.lanes faults.course",
        "faults.bench",
        "faults.outcomes faults.cases faults.plan",
        "faults.frames faults.merge faults.host faults.classifier",
        "faults.run",
        "asic.library asic.opensta",
        "asic.gating",
        "asic.synthesis",
        "asic.clocks asic.compare asic.constraints",
        "asic.equivalence asic.timing",
        "asic.structure",
        "gates",
        "power",
        "scale",
        "layout.transistors layout.environment layout.stages",
        "layout.cells layout.checks",
        "layout.netlist",
        "layout.report",
        "layout",
        "asic.report fpga",
        "commands.outcome",
        "commands",
        "__main__",
    ),
    "snn": (
        "flat cache rounding adam",
        "kernels",
        "network_config",
        "network calibration",
        "data",
        "training checkpoint",
        "train",
        "exchange",
        "experiments",
        "studies",
        "figures",
        "commands",
        "__main__",
    ),
    "cocotb_tests": ("bench", "session", "touch soak", "commands", "__main__", "conftest test_"),
}
"""Rooms of each package from the ground up. A file imports from its own layer and from those below it."""

MAY_USE = {
    "model": {"model"},
    "rtl": {"model", "rtl"},
    "flow": {"model", "rtl", "cocotb_tests", "flow"},
    "snn": {"model", "snn"},
    "cocotb_tests": {"model", "rtl", "cocotb_tests"},
}
PARSE_AND_PRINT = ("cli", "commands", "__main__")
MOST_FILES = 13
MOST_LINES_OF_A_FUNCTION = 60
MOST_PARAMETERS = 8

LONG = {
    "model.readout._loop": "arrays handed on to a part of the loop would cost a third of its speed",
    "snn.kernels.triton.forward_kernel": "a GPU kernel takes pointers and sizes one by one",
    "snn.kernels.triton.backward_kernel": "a GPU kernel takes pointers and sizes one by one",
    "snn.kernels.triton._product": "part of a GPU kernel, which knows no structures",
}
"""Functions above 60 lines, and parameter lists above eight, each with the reason why."""


def files() -> list[Path]:
    return sorted(path for package in LAYERS for path in (ROOT / package).rglob("*.py"))


def name_of(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


@cache
def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text())


@cache
def imports() -> dict[str, set[str]]:
    """Return, for every module of the packages, those of them that it imports, anywhere in it."""
    modules = {name_of(path): path for path in files()}
    found: dict[str, set[str]] = {}
    for name, path in modules.items():
        wanted: set[str] = set()
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.ImportFrom):
                assert node.module, f"{path} has a relative import"
                assert not node.level, f"{path} has a relative import"
                wanted |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
            elif isinstance(node, ast.Import):
                wanted |= {alias.name for alias in node.names}
        # A package stands for its __init__ alone, which imports nothing here.
        found[name] = {m for m in wanted & set(modules) if modules[m].name != "__init__.py"} - {name}
    return found


def layer_of(module: str) -> int:
    """Return the number of the layer of a module; the longest name that fits counts."""
    package, _, rest = module.partition(".")
    fits = [
        (len(room), number)
        for number, rooms in enumerate(LAYERS[package])
        for room in rooms.split()
        if rest == room or rest.startswith(f"{room}.") or (room.endswith("_") and rest.startswith(room))
    ]
    assert fits, f"{module} has no place in the house; give it one in LAYERS"
    return max(fits)[1]


def functions(path: Path) -> Iterator[tuple[str, ast.FunctionDef | ast.AsyncFunctionDef]]:
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield f"{name_of(path)}.{node.name}", node


def test_imports_run_one_way() -> None:
    upward = [
        f"{module} imports {other}"
        for module, others in imports().items()
        for other in others
        if other.partition(".")[2]
        and module.partition(".")[2]
        and (
            other.partition(".")[0] not in MAY_USE[module.partition(".")[0]]
            or (module.partition(".")[0] == other.partition(".")[0] and layer_of(other) > layer_of(module))
        )
    ]
    assert len(imports()) > 100
    assert not upward


def test_there_is_no_circle() -> None:
    try:
        TopologicalSorter(imports()).prepare()
    except CycleError as circle:
        pytest.fail(f"these import each other: {circle.args[1]}")


def test_only_commands_parse_and_print() -> None:
    for path in files():
        room = path.relative_to(ROOT).parts[1].removesuffix(".py")
        if room in PARSE_AND_PRINT:
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
        assert len(modules) <= MOST_FILES, f"{folder} has {len(modules)} files"


def test_functions_stay_short() -> None:
    for path in files():
        for name, node in functions(path):
            lines = (node.end_lineno or 0) - node.body[0].lineno + 1  # without signature and decorators
            if ast.get_docstring(node) and len(node.body) > 1:
                lines = (node.end_lineno or 0) - node.body[1].lineno + 1
            parameters = node.args.posonlyargs + node.args.args + node.args.kwonlyargs
            count = sum(argument.arg not in ("self", "cls", "ctx") for argument in parameters)
            command = path.parent.name == "commands" or path.name == "__main__.py"
            if name not in LONG:
                assert lines <= MOST_LINES_OF_A_FUNCTION, f"{name} has {lines} lines"
                assert command or count <= MOST_PARAMETERS, f"{name} has {count} parameters"


def test_every_exception_is_needed() -> None:
    known = {name for path in files() for name, _ in functions(path)}
    assert set(LONG) <= known


def test_packages_import_nothing_by_themselves() -> None:
    for path in files():
        if path.name == "__init__.py":
            assert not any(isinstance(node, ast.Import | ast.ImportFrom) for node in ast.walk(tree(path))) or (
                path == ROOT / "model" / "__init__.py"
            ), path
