"""Run a make target: ``python -m eskin.app.make TARGET``.

The variables of a target are the options of its command: ROWS=12 is ``--rows 12``. They come in MAKEFLAGS, as make
hands them on: no shell reads them, and no exported variable is mistaken for one. Only the standard library is imported
before the packages are installed.
"""

import contextlib
import difflib
import os
import re
import shlex
import shutil
import subprocess
import sys
from typing import Any

from eskin.app.catalogue import COMMANDS, sections, summaries, words_of
from eskin.app.leave import EXIT_INPUT_ERROR, leave_quietly
from eskin.app.setup import APART, BASE, VENV, groups, install, install_apart, missing, python
from eskin.app.uv import SetupError
from eskin.board.bitstream.boards import BOARDS

YES, NO = ("1", "yes", "true"), ("", "0", "no", "false")

SWITCHES = {tuple(found.switch.split()): name for name, found in COMMANDS.items() if found.switch}
"""Command that runs instead of a target, by the target and a variable that a user sets to 1."""

LINT = ("-m ruff format --check .", "-m ruff check .", "-m mypy")
MEASURED = "benchmarks/results"
STEPS: dict[str, tuple[str, tuple[str, ...]]] = {
    "setup": ("install all packages, or those of a command or group [FOR=sim]; a target installs what it needs", ()),
    "docs": (
        "build the site of documents and reference pages, out/site/index.html",
        (
            "-m docs.tables",
            "docs/figures/architecture.py",
            "docs/tutorial_page.py",
            "-m mkdocs build --quiet",
            "-c 'print(\"out/site/index.html\")'",
        ),
    ),
    "bench": (
        "measure speed against peers and limits; JSON in benchmarks/results, tables in docs",
        (
            *(
                f"benchmarks/{n}.py --json {MEASURED}/{n}.json"
                for n in ("encoder", "cosim", "training", "player", "udp", "leak")
            ),
            f"benchmarks/encoder.py --signals 64 --samples 200000 --json {MEASURED}/encoder_64.json",
            f"benchmarks/network.py --steps 200 --json {MEASURED}/network.json",
            *(
                f"benchmarks/scale.py {n} --json {MEASURED}/scale_{n}.json"
                for n in ("encoders", "tiles", "arrays", "skins")
            ),
            "-m docs.tables",
        ),
    ),
    "check": (
        "run in a minute lint, types, layers, and a test of every block and command",
        (*LINT, "-m pytest -q -m quick -n 2 --dist worksteal"),
    ),
    "test": ('run all tests [PYTEST="-k name"]', ("-m pytest -n auto --dist worksteal $PYTEST",)),
    "lint": ("check format, lint and types", LINT),
    "pins": (
        "write constraints.txt anew from pyproject.toml [UV='--upgrade-package numpy']",
        (
            "-m uv pip compile --quiet --no-config --universal --python-version 3.11 --all-extras --no-annotate "
            "--custom-compile-command 'make pins' --output-file constraints.txt pyproject.toml $UV",
        ),
    ),
    "format": ("format the code", ("-m ruff format .", "-m ruff check --fix .")),
}
"""Help and command lines of the targets that are no command; the interpreter runs each line."""

OWN = {"help": "list the targets", "clean": "remove builds and cached scans; .venv and out/ stay"}
ENDING = """\
A variable is an option of the target's command: ROWS=12 is --rows 12, WAVES=1 is --waves. A wrong name is refused.
eskin COMMAND --help lists the options; the checks of the project are eskin dev COMMAND.
make sim GATES=1 runs gatesim.
Example: make sim ROWS=12 COLUMNS=16 ENCODING=nlcs RESOLUTION=6 SIM=icarus WAVES=1"""

TARGETS = [*OWN, *STEPS, *COMMANDS]
BUILT = ("build", ".pytest_cache", ".mypy_cache", ".ruff_cache", ".hypothesis")
INSIDE = "--inside"  # argument of the launcher in the environment's interpreter


def typed_variables(flags: str) -> dict[str, str]:
    r"""Return the variables set on make's command line, from the part of MAKEFLAGS after ``--``.

    A space is written ``\ `` there, a backslash ``\\`` and a dollar ``$$``.

    Examples
    --------
    >>> typed_variables(r"k -- OUT=it's\ $$HOME ROWS=3")
    {'OUT': "it's $HOME", 'ROWS': '3'}
    """
    _, separator, text = f" {flags}".partition(" -- ")
    found = {}
    for word in re.findall(r"(?:\\.|[^\\ ])+", text if separator else "", re.DOTALL):
        plain = re.sub(r"\\(.)", r"\1", word, flags=re.DOTALL).replace("$$", "$")
        if parts := re.fullmatch(r"([^\s=]+?)(?:::?:?|[+?!])?=(.*)", plain, re.DOTALL):
            found[parts[1]] = parts[2]
    return {name: found[name] for name in sorted(found)}


def options_of(target: str) -> dict[str, Any]:
    """Return the parameters of a target by variable name."""
    if target == "setup":
        return {"FOR": None}
    if target not in COMMANDS:
        return {name: None for step in STEPS[target][1] for name in re.findall(r"\$(\w+)", step)}
    from eskin.app.cli import Commands

    found = {}
    for parameter in Commands(COMMANDS)[target].params:
        words = [word for word in parameter.opts if word.startswith("--")] or [str(parameter.name)]
        found[words[0].lstrip("-").replace("-", "_").upper()] = parameter
    return {name: parameter for name, parameter in found.items() if name != "HELP"}


def needs_of(target: str, variables: dict[str, str]) -> list[str]:
    """Return the extras that a target needs."""
    if target == "setup" and (words := variables.get("FOR", "").split()):
        if unknown := [word for word in words if word not in (*groups(), *COMMANDS, *STEPS)]:
            raise SetupError(f"there is no command or group {unknown[0]}{_nearest(unknown[0], [*COMMANDS, *groups()])}")
        found = [group for word in words for group in ([word] if word in groups() else needs_of(word, {}))]
        return list(dict.fromkeys([BASE, *found]))
    if target in ("setup", "test", "check"):  # the quick tests are of all blocks
        return groups()
    if target in ("format", "pins"):
        return [BASE, "dev"]
    if target not in COMMANDS:
        return [BASE, "sim", "snn", "dev", *(["docs"] if target == "docs" else [])]
    more = ["registers"] if variables.get("REGISTERS") == "spi" else []
    more += ["lint"] if "DUT" in variables else []
    board = BOARDS.get(variables.get("BOARD", "")) if target == "fpga" else None
    more += [board.family.group] if board else []
    return list(dict.fromkeys([BASE, *COMMANDS[target].needs.split(), *more]))


def command_lines(target: str, parameters: dict[str, Any], variables: dict[str, str]) -> list[list[str]]:
    """Return the command lines of a target."""
    if target in COMMANDS:
        given = dict(word.split("=") for word in COMMANDS[target].variables.split()) | variables
        return [[python(), "-m", "eskin", *words_of(target), *_arguments(parameters, given)]]

    def filled(word: str) -> list[str]:
        return shlex.split(variables.get(word[1:], "")) if word.startswith("$") else [word]

    return [[python(), *(part for word in shlex.split(step) for part in filled(word))] for step in STEPS[target][1]]


def _arguments(parameters: dict[str, Any], variables: dict[str, str]) -> list[str]:
    options: list[str] = []
    positional: list[str] = []
    for name in (name for name in parameters if name in variables):
        parameter, value = parameters[name], variables[name]
        option = next((word for word in parameter.opts if word.startswith("--")), "")
        if parameter.param_type_name == "argument":
            positional.append(value)
        elif parameter.is_flag:
            off = parameter.secondary_opts if parameter.default is True else []
            options += [option] if _is_yes(name, value) else off
        else:
            options += [f"{option}={word}" for word in (value.split() if name in ("SET", "DUT") else [value])]
    return [*options, *(["--", *positional] if positional else [])]


def _is_yes(name: str, value: str) -> bool:
    if value not in YES + NO:
        raise SetupError(f"{name} is 1 or 0, not {value!r}")
    return value in YES


def main() -> None:
    """Run a make target."""
    flags, name = os.environ.get("MAKEFLAGS", ""), sys.argv[1]
    first = flags.split(" ")[0]  # the one-letter flags of make
    dry = "n" in first and not first.startswith("-") and "=" not in first
    try:
        leave_quietly(lambda: _make(name, typed_variables(flags), dry))
    except SetupError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(EXIT_INPUT_ERROR)


def _make(name: str, variables: dict[str, str], dry: bool) -> None:
    """Check the variables, install missing packages, and run the target."""
    if name not in TARGETS:
        raise SetupError(f"there is no target {name}{_nearest(name, TARGETS)}")
    target, switches = name, [switch for owner, switch in SWITCHES if owner == name]
    for switch in switches:
        target = SWITCHES[name, switch] if _is_yes(switch, variables.pop(switch, "")) else target
    if target in OWN:
        _check(name, variables, [])
        print_help() if target == "help" else _clean(dry)
        return
    wanted = needs_of(target, variables)
    if target in COMMANDS:
        if missing([BASE]) and not dry:
            install(wanted)
        if os.path.exists(python()) and INSIDE not in sys.argv:
            os.execv(python(), [python(), "-m", "eskin.app.make", name, INSIDE])
    parameters = options_of(target)
    _check(name, variables, [*parameters, *switches])
    lines = command_lines(target, parameters, variables)
    if dry:
        print("\n".join(shlex.join(line) for line in lines))
        return
    install(wanted)
    if target in APART:
        install_apart(target)
    if target == "setup":
        print(f"{VENV} has the packages of {', '.join(wanted)}")
    for number, line in enumerate(lines, 1):
        if len(lines) > 1:
            print(f"[{number}/{len(lines)}] {shlex.join(line[1:])}", file=sys.stderr, flush=True)
        _call(line)


def _check(name: str, variables: dict[str, str], known: list[str]) -> None:
    """Raise an error for the first unknown variable, with the most similar name."""
    for variable in variables:
        if variable not in known and variable != "PYTHON":  # the Makefile itself uses this variable
            raise SetupError(f"make {name} does not take {variable}{_nearest(variable, known)}")


LEFT_OUT = ("MAKEFLAGS", "MFLAGS", "MAKEOVERRIDES", "MAKELEVEL", "PYTHONDONTWRITEBYTECODE")
"""Variables that commands do not get. With the last variable, which container images set, every process and simulator
would compile PyTorch or pytest anew: twice the time of all tests."""


def _call(line: list[str]) -> None:
    """Run a command line without make's environment variables; exit with its code if it fails."""
    outer = {k: v for k, v in os.environ.items() if k not in LEFT_OUT}
    process = subprocess.Popen(line, env=outer | {"NO_MKDOCS_2_WARNING": "1"})
    code = None
    while code is None:
        with contextlib.suppress(KeyboardInterrupt):  # the command receives Ctrl-C too, and ends by itself
            code = process.wait()
    if code:
        sys.exit(code if code > 0 else 128 - code)


def print_help() -> None:
    """Print the targets, and how to set options of a command."""
    project = OWN | {name: text for name, (text, _) in STEPS.items()}
    listed = {"Project": project} | summaries()
    print("\n".join(["make TARGET [VARIABLE=value ...]", *sections(listed, width=999), "", ENDING]))


def _clean(dry: bool) -> None:
    clear = [python(), "-m", "eskin", "cache", "--clear"]
    if dry:
        print(shlex.join(clear), shlex.join(["rm", "-r", *BUILT]), sep="\n")
        return
    if os.path.exists(python()):
        subprocess.run(clear, check=False)
    for folder in BUILT:
        shutil.rmtree(folder, ignore_errors=True)


def _nearest(word: str, known: list[str]) -> str:
    """Return the end of an error message, with the known word most similar to a given word."""
    return f"; did you mean {difflib.get_close_matches(word, known, 1, 0)[0]}?" if known else "; it takes no variable"


if __name__ == "__main__":
    main()
