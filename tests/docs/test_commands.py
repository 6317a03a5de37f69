"""Test that the program accepts every command printed in README, pages and data.

All are parsed as printed: options, values, arguments. Many would take minutes, or need a dataset, a cell library or a
board; ``RUN`` are run as printed. The test marked as the command's own runs its smallest form.
"""

import ast
import importlib
import json
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import skimage.data
import typer
from PIL import Image
from typer._click.exceptions import MissingParameter

from eskin.app import make
from eskin.app.catalogue import COMMANDS, DEV, words_of
from eskin.base.errors import InputError
from tests.conftest import command
from tests.skins import write_skin

ROOT = Path(__file__).parents[2]
PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *(ROOT / folder / "README.md" for folder in ("studies", "cocotbext-aer", "cocotb_tests/independent")),
    ROOT / "skin" / "recordings" / "finger" / "README.md",
    *sorted((ROOT / "docs").rglob("*.md")),
]
"""All pages but the changelog, which also names commands of the past."""
FENCE = re.compile(r"^```\w*\n(.*?)^```", re.DOTALL | re.MULTILINE)
RUN = (
    "eskin encode skin.csv --sample-rate 1000 --rows 2 --columns 3 -o skin.npz",
    "eskin decode skin.npz -o rebuilt.csv",
    "make power",
    "eskin power --correct afe_settling,pads",
    "eskin power --mode consistent --crossover",
    "eskin power --parameters",
    "make explore ROWS=12 COLUMNS=16",
    "eskin explore --rows 12 --columns 16 --bandwidth 500 --noise 2e-4 --event-rate 30000",
    "eskin rates --preset physical --dataset embedded --limit 12",
    "eskin encode brick.png -o brick.npz --encoding lcs --resolution 4",
    "eskin compare brick.npz brick.npz",
    "eskin decode brick.npz -o rebuilt.npz --plot rebuilt.png",
    "eskin convert brick.npz -o brick.nir",
    "make verilog ROWS=12 COLUMNS=16 LINK=four_phase",
    "eskin verilog --receptive-fields both -o out/verilog",
    "eskin encode my_skin -o events",
    "make train DATA=my_skin",
    "make quantise",
    "make predict DATA=new/",
    "eskin export out/train/weights.npz -o net.nir",
    "eskin import net.nir -o weights.npz",
)
"""Commands that take a few seconds at most, in the order in which a reader would type them."""


PROGRAM = re.compile(r"(make|eskin|fusesoc|(\.venv/bin/)?python(?= -m | \S+\.py\b)) ")
"""Beginning of a command that a page prints."""

OPTIONS = {
    "studies": {"--out", "--workers", "--scheduler", "--comparator", "--loops", "--scan"},
    "docs": {"--again", "--check"},
    "tests": set(),
    "pip": {"--no-deps", "-c"},
    "dask": {"--host", "--port", "--no-dashboard", "--nthreads", "--nworkers"},
}
"""Options of programs that ``python -m`` runs, by their package."""


class Printed(NamedTuple):
    """A command printed on a page; ``whole`` if a reader would copy it."""

    page: str
    text: str
    whole: bool


def printed() -> Iterator[Printed]:
    """Yield the commands on all pages: in code blocks, sentences and tables."""
    for page in PAGES:
        text, name = page.read_text(), str(page.relative_to(ROOT))
        blocks = [line for block in FENCE.findall(text) for line in typed(block)]
        rest = FENCE.sub("", text)
        for line in [*blocks, *re.findall(r"^    (.*)$", rest, re.MULTILINE)]:
            for part in re.split(r" && |; ", re.sub(r"\s+#.*", "", line).removeprefix("$ ").strip()):
                if PROGRAM.match(part):
                    yield Printed(name, part, True)
        for mention in re.findall(r"`([^`]*)`", rest):
            if PROGRAM.match(mention):
                yield Printed(name, " ".join(mention.split()), name == "README.md")


def stored() -> Iterator[Printed]:
    """Yield the commands that made the data."""
    for folder in ("docs/data", "benchmarks/results", "power"):
        for path in sorted((ROOT / folder).rglob("*.json")):
            for text in commands_in(json.loads(path.read_text())):
                yield from (Printed(str(path.relative_to(ROOT)), part, False) for part in text.split("; "))


def commands_in(content: Any) -> Iterator[str]:
    """Yield the texts below the names of commands in JSON data."""
    if isinstance(content, list):
        for one in content:
            yield from commands_in(one)
    elif isinstance(content, dict):
        for name, value in content.items():
            named = {"command": [value], "commands": value, "trained with": value}.get(name)
            yield from named.values() if isinstance(named, dict) else named or commands_in(value)


def typed(block: str) -> list[str]:
    lines = block.replace("\\\n", " ").splitlines()
    return [line for line in lines if line.startswith("$ ")] or lines


def words_behind(text: str) -> list[str]:
    """Return the words of a command without marks of optional parts."""
    words = shlex.split(re.sub(r"[\[\]]|\.\.\.", " ", text))[1:]
    return ["0" if re.fullmatch("[A-Z]", word) else word for word in words]


def problem_of(words: list[str], whole: bool) -> str:
    """Return the error in the words after ``eskin``, or an empty text."""
    if words == ["--help"]:
        return ""
    name = words[1] if words[:1] == [DEV] and len(words) > 1 else words[0]
    if name not in COMMANDS or words[: len(words_of(name))] != words_of(name):
        return "no such command"
    words = words[words.index(name) :]
    if not whole:
        known = {
            option for parameter in command(words[0]).params for option in (*parameter.opts, *parameter.secondary_opts)
        }
        given = {word.partition("=")[0] for word in words[1:] if word.startswith("--")} - {"--", "--help"}
        return ", ".join(sorted(given - known))
    try:
        found = command(words[0])
        found.check(found.make_context(words[0], words[1:]))
    except MissingParameter as error:
        return "" if len(words) == 1 else error.format_message()  # a name alone is a name
    except typer.TyperException as error:
        return str(error.format_message())
    except InputError as error:
        return str(error)
    return ""


def problem_of_program(words: list[str]) -> str:
    """Return the error in the words after ``python``: a program that does not exist, or an unknown option."""
    if words[0] == "-m":
        package = words[1].partition(".")[0]
        if package == "eskin":
            return problem_of(words[2:] or ["--help"], False)
        if package not in OPTIONS or importlib.util.find_spec(words[1]) is None:
            return "no such program"
        known = OPTIONS[package]
    elif not (ROOT / words[0]).is_file():
        return "no such program"
    else:
        functions = (
            node for node in ast.parse((ROOT / words[0]).read_text()).body if isinstance(node, ast.FunctionDef)
        )
        names = {
            argument.arg.replace("_", "-") for main in functions if main.name == "main" for argument in main.args.args
        }
        known = {f"--{name}" for name in names} | {"--json"}
    given = {word.partition("=")[0] for word in words[1:] if word.startswith("--")}
    return ", ".join(sorted(given - known))


def test_every_printed_command_is_taken(monkeypatch: pytest.MonkeyPatch, dry_make: Any) -> None:
    monkeypatch.chdir(ROOT)
    found = sorted({*printed(), *stored()})
    assert len(found) > 150
    wrong = []
    for page, text, whole in found:
        if text.startswith("eskin "):
            problem = problem_of(words_behind(text), whole)
        elif text.startswith("fusesoc "):
            needs = f"`{text}` (needs `verilator` on PATH)"
            problem = "" if needs in (ROOT / page).read_text() else "the page does not say that it needs verilator"
        elif re.match(r"(\.venv/bin/)?python ", text):
            problem = problem_of_program(words_behind(text))
        elif not text.startswith("make "):
            problem = "no such program"
        else:
            _, lines, problem = dry_make(*words_behind(text))
            for line in lines:
                if line[1:3] == ["-m", "eskin"] and text != "make clean":
                    problem += problem_of(line[3:], whole)
        wrong += [f"{page}: {text}: {problem}"] if problem else []
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("eskin encod x.csv", "no such command"),
        ("eskin formal", "no such command"),
        ("eskin dev formal", ""),
        ("eskin power --mod paper", "No such option: --mod"),
        ("eskin verilog --rows", "Option '--rows' requires an argument"),
        ("eskin compare a.npz", "Missing argument 'B'"),
        ("eskin train --fold x", "Invalid value for '--fold'"),
    ],
)
def test_a_wrong_command_is_found(text: str, problem: str) -> None:
    assert problem_of(words_behind(text), True).startswith(problem)


@pytest.mark.usefixtures("shorter")
def test_these_run_as_printed(folder: Path, call: Any) -> None:
    shown = {text for _, text, _ in printed()}
    np.savetxt(
        "skin.csv", np.random.default_rng(0).uniform(-0.5, 0.5, (200, 6)).cumsum(0) / 40, delimiter=",", fmt="%.4f"
    )
    Image.fromarray(skimage.data.brick()[:64, :300]).save("brick.png")
    write_skin(folder / "my_skin", each=6, taxels=4)
    shutil.copytree("my_skin/tap", "new")
    for text in RUN:
        assert text in shown, text
        name, *words = words_behind(text)
        if text.startswith("make"):
            line = make.command_lines(name, make.options_of(name), dict(word.split("=", 1) for word in words))[0][3:]
        else:
            line = [name, *words]
        code, out, err = call(" ".join(line))
        assert (code, err) == (0, ""), text
        assert out, text
    assert {"skin.npz", "rebuilt.csv"} <= {path.name for path in folder.iterdir()}


def missing_calls(texts: Iterable[str]) -> str:
    """Return errors for the calls in sentences, such as `nir.read(...)`, after an import of the library alone."""
    libraries = "nir|nirtorch|norse|snntorch|torch|eskin"
    calls = {call for text in texts for call in re.findall(rf"`((?:{libraries})(?:\.\w+)+)\(", FENCE.sub("", text))}
    program = (
        "import functools, importlib, sys\n"
        "for call in sys.argv[1:]:\n"
        "    library, *names = call.split('.')\n"
        "    try: functools.reduce(getattr, names, importlib.import_module(library))\n"
        "    except AttributeError as error: print(call, error)"
    )
    done = subprocess.run([sys.executable, "-c", program, *sorted(calls)], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_every_call_of_a_library_is_there() -> None:
    assert missing_calls(page.read_text() for page in PAGES) == ""
    assert missing_calls(["call `snntorch.utils.reset(net)`, not `torch.zeros(3)`"]).startswith("snntorch.utils.reset ")
