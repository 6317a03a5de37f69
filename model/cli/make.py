"""``python -m model.cli.make TARGET``: what a target of the Makefile runs, with the variables typed behind make.

Variables come as make hands them on, in MAKEFLAGS: no shell reads them, and what the user's shell exports is not
taken for one. Those that a target takes are the options of its command: ROWS=12 is ``--rows 12``. Only the standard
library is imported before the packages are installed.
"""

from __future__ import annotations

import difflib
import importlib
import os
import re
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass, field
from typing import Any, NoReturn

from model.cli.setup import BASE, SetupError, groups, install, install_apart, missing, python

EXIT_INPUT_ERROR = 2
YES, NO = ("1", "yes", "true"), ("", "0", "no", "false")
SPLIT = ("SET", "PYTEST")
"""Variables that hold several words."""

OF_MAKE = ("PYTHON",)
"""Variables that make itself uses, with every target."""


@dataclass(frozen=True)
class Target:
    """What a target runs.

    Parameters
    ----------
    help : str
        Its line of ``make help``.
    command : str
        ``PACKAGE COMMAND`` of the project, whose options are the variables; empty for a target of steps.
    needs : tuple of str
        Groups of packages beside ``base``; ``("all",)`` for all of them.
    steps : tuple of str
        Command lines behind the interpreter; ``$NAME`` stands for the words of a variable.
    defaults : dict of str to str
        Variables that the target sets where the user does not.
    instead : dict of str to str
        Variables with which a default is not set.
    apart : str
        Environment of its own that its command runs programs of, a name of ``APART``.
    switches : dict of str to Target
        What runs in its place where a user sets a variable to 1.
    """

    help: str
    command: str = ""
    needs: tuple[str, ...] = ()
    steps: tuple[str, ...] = ()
    defaults: dict[str, str] = field(default_factory=dict)
    instead: dict[str, str] = field(default_factory=dict)
    apart: str = ""
    switches: dict[str, Target] = field(default_factory=dict)


SIM, SNN, DEV, ALL = ("sim",), ("snn",), ("sim", "snn", "dev"), ("all",)
LINT = ("-m ruff format --check .", "-m ruff check .", "-m mypy")
BENCH = tuple(f"benchmarks/{name}.py --json benchmarks/results/{name}.json" for name in ("encoder", "cosim", "network"))

TARGETS = {
    "help": Target("list the targets"),
    "setup": Target("virtual environment with all pinned packages (every target installs what it needs)", needs=ALL),
    "sim": Target(
        "hold RTL, or its netlist, to the model on scenarios, textures, recordings [DATA= SIM= GATES=1 LIB= OUT=]",
        "cocotb_tests sim",
        SIM,
        switches={"GATES": Target("", "flow gatesim", ("sim", "asic"))},
    ),
    "replay": Target(
        "a whole dataset or DATA=my_skin/ through RTL and model [DATASET= PRESET= LIMIT= SCHEDULER= OUT=]",
        "cocotb_tests replay",
        SIM,
    ),
    "touch": Target(
        "texture to class as one chip, held to its models [DATASET= DATA= WEIGHTS= LIMIT=]",
        "cocotb_tests touch",
        SIM,
    ),
    "soak": Target(
        "random configurations through RTL and model, resumable; a failure becomes one command [HOURS= CLOCKS= OUT=]",
        "cocotb_tests soak",
        SIM,
    ),
    "verilog": Target(
        "write Verilog, constraints, port list, core, datasheet [READOUT=spiking|frame REGISTERS=spi REPORT= OUT=]",
        "rtl verilog",
        defaults={"OUT": "out/verilog"},
    ),
    "gates": Target("gates and flops of readouts, or of a classifier [LIBERTY=cells.lib CLASSIFIER=]", "rtl gates"),
    "asic": Target(
        "gated netlist: proof, timing, power [LIB=typ.lib SLOW= FAST= READOUT= POWER=0 SCALE=1 NAME= OUT=]",
        "flow asic",
        ("sim", "asic"),
        switches={"SCALE": Target("", "flow asic-scale", ("asic",))},
    ),
    "gatepower": Target(
        "power of gated netlists from what they do, in two ways [LIB=cells.lib ENCODING= THREE=1 OUT=]",
        "flow power",
        ("sim", "asic"),
    ),
    "layout": Target(
        "lay the readout out in 130 nm rules and check it, 2 x 2 taxels [ROWS= COLUMNS= COMPARE=0 NAME= OUT=]",
        "flow layout",
        ("asic",),
        defaults={"ROWS": "2", "COLUMNS": "2"},
        apart="layout",
    ),
    "fpga": Target(
        "bitstream of a board: clock, LUTs, memory, routed [BOARD=ulx3s WEIGHTS= RECEIVER=1 ALONE=8 OUT=]",
        "flow fpga",
        ("fpga",),
    ),
    "formal": Target(
        "prove what the RTL promises, block by block [BLOCK= SMALL=1 MUTANTS=1 OUT=]",
        "flow formal",
    ),
    "faults": Target(
        "upset every flop, one at a time, and meet hostile surroundings [SMALL=1 OUT=]",
        "flow faults",
    ),
    "coverage": Target(
        "lines, branches, toggles, points of the specification that runs held to the models reach [SMALL=1 ONLY= OUT=]",
        "flow coverage",
        ("sim", "dev", "registers"),
    ),
    "properties": Target(
        "the properties as SystemVerilog, bound to the Verilog of make verilog [OUT=]",
        "flow properties",
        defaults={"OUT": "out/verilog"},
    ),
    "mutants": Target(
        "wrong edits of RTL or model, to be killed by tests or proofs; resumable [BLOCK= SHARE= WORKERS= MODEL=1]",
        "flow mutants",
        ("sim", "dev"),
        switches={"MODEL": Target("", "flow model-mutants", ("sim", "snn", "dev", "mutants"))},
    ),
    "crosscheck": Target(
        "the delivered Verilog in CXXRTL, a third simulator, against the model; lint by slang [TEXTURE= TICKS= OUT=]",
        "flow crosscheck",
        ("sim", "lint"),
    ),
    "crossproof": Target(
        "what make formal proved, searched by a second solver, z3 [BLOCK= SMALL=1 MUTANTS=1 OUT=]",
        "flow crossproof",
        ("proof",),
    ),
    "rates": Target("mean population event rate over a dataset [DATASET= PRESET= LIMIT=]", "model rates"),
    "train": Target(
        'train one network [DATA=my_skin/ RECIPE= FRAMES= SET="NAME=VALUE ..." EPOCHS= FOLD= OUT=]', "snn train", SNN
    ),
    "crossval": Target(
        "folds x seeds, resumable [DATA= PRESET= ENCODING= RESOLUTION= FOLDS= SEEDS=]", "snn crossval", SNN
    ),
    "predict": Target(
        "classify recordings; RTL spikes against model spikes [WEIGHTS= EVENTS= DATA= CHECK_MODEL=1]",
        "snn predict",
        SNN,
        defaults={"WEIGHTS": "out/train/weights.npz", "EVENTS": "out/replay"},
        instead={"DATA": "EVENTS"},
    ),
    "sweep": Target("accuracy by data rate: many points, resumable [POINTS= DATA= SCHEDULER=]", "snn sweep", SNN),
    "robustness": Target(
        "trained networks under noise, mismatch, faults and other movements, resumable [WEIGHTS=out/train ONLY= OUT=]",
        "snn robustness",
        SNN,
    ),
    "noise-power": Target(
        "accuracy against total power of trained networks at one AFE noise [WEIGHTS=out/train NOISES=mV,... OUT=]",
        "snn noise-power",
        SNN,
    ),
    "merits": Target(
        "what events and frames are good for: latency, rest, noise, timing [WEIGHTS= PAIR=A,B NOISE= LIMIT= OUT=]",
        "snn merits",
        SNN,
    ),
    "precision": Target(
        "trained networks as whole numbers of few bits: accuracy by memory and additions [WEIGHTS=out/train OUT=]",
        "snn precision",
        SNN,
    ),
    "power": Target("power of the three readouts [MODE= RESOLUTION= NOISE= TAU= CROSSOVER=1]", "model power"),
    "fig6": Target("power at three noise targets in both modes, data and picture [OUT= SYNTHESIS=]", "model fig6"),
    "fig7": Target("noise at which spikes and frames cost the same [OUT= SYNTHESIS=]", "model fig7"),
    "fig8": Target(
        "one scan through a trained network, texture to class [WEIGHTS= IMAGE= DATA= OUT=]", "snn fig8", SNN
    ),
    "fig9": Target("accuracy against data rate and confusion, published and ours [SWEEP= OUT=]", "snn fig9"),
    "sensitivity": Target("what each correction of the power model does [OUT= SYNTHESIS=]", "model sensitivity"),
    "explore": Target("cheapest readout for your sensor [ROWS= BANDWIDTH= NOISE= EVENT_RATE=]", "model explore"),
    "frames": Target("events against frames on the same scans [RESOLUTION= FRAME_RATE= LIMIT=]", "model frames"),
    "study": Target("SNR by data rate on slow signals, beside uniform sampling [DATA=my_skin/ OUT=]", "model study"),
    "report": Target("one HTML page with all figures, for a browser [OUT= SYNTHESIS=]", "model report"),
    "docs": Target(
        "the site of documents and reference pages, out/site/index.html",
        needs=(*DEV, "docs"),
        steps=(
            "-m docs.tables",
            "docs/commands.py",
            "docs/registers.py",
            "docs/figures/architecture.py",
            "docs/tutorial_page.py",
            "-m mkdocs build --quiet",
            "-c 'print(\"out/site/index.html\")'",
        ),
    ),
    "bench": Target(
        "speed against peers and limits, in one run each; JSON in benchmarks/results", needs=DEV, steps=BENCH
    ),
    "check": Target(
        "in a minute: lint, types, layers, and a test of every block and command",
        needs=DEV,
        steps=(*LINT, "-m pytest -q -m quick -n 2 --dist worksteal"),
    ),
    "test": Target(
        'run all tests [PYTEST="-k name"]', needs=ALL, steps=("-m pytest -n auto --dist worksteal $PYTEST",)
    ),
    "lint": Target(
        "format check, lint and types",
        needs=DEV,
        steps=LINT,
    ),
    "format": Target("format the code", needs=DEV, steps=("-m ruff format .", "-m ruff check --fix .")),
    "clean": Target("remove what was built and the recorded scans that are kept, not the virtual environment and out/"),
}

GROUP_OF = {("REGISTERS", "spi"): "registers"}
"""Groups of packages that a value of a variable needs."""

BUILT = ("build", ".pytest_cache", ".mypy_cache", ".ruff_cache", ".hypothesis")
INSIDE = "--inside"
"""Said by the launcher to itself, when it goes on in the environment's interpreter."""

ENVIRONMENT = {"NO_MKDOCS_2_WARNING": "1"}


def typed_variables(flags: str) -> dict[str, str]:
    r"""Return the variables of a command line of make, from its MAKEFLAGS, where they stand behind ``--``.

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


def options_of(target: Target) -> dict[str, Any]:
    """Return the parameters of a target's command by the name of their variable."""
    if not target.command:
        return {name: None for step in target.steps for name in re.findall(r"\$(\w+)", step)}
    import typer

    package, name = target.command.split()
    app = importlib.import_module(f"{package}.__main__").app
    found = {}
    for parameter in typer.main.get_command(app).commands[name].params:  # type: ignore[attr-defined]
        words = [word for word in parameter.opts if word.startswith("--")] or [parameter.name]
        found[words[0].lstrip("-").replace("-", "_").upper()] = parameter
    return {name: parameter for name, parameter in found.items() if name != "HELP"}


def check_variables(name: str, variables: dict[str, str], known: list[str]) -> None:
    """Refuse the first variable that a target does not take, with the nearest one that it takes."""
    for variable in variables:
        if variable not in known and variable not in OF_MAKE:
            _fail(f"make {name} does not take {variable}{_nearest(variable, known)}")


def arguments(parameters: dict[str, Any], variables: dict[str, str]) -> list[str]:
    """Return the words behind a command that its variables stand for."""
    options: list[str] = []
    positional: list[str] = []
    for name, parameter in parameters.items():
        if name not in variables:
            continue
        value = variables[name]
        if parameter.param_type_name == "argument":
            positional.append(value)
            continue
        option = next(word for word in parameter.opts if word.startswith("--"))
        if parameter.is_flag:
            if value not in YES + NO:
                _fail(f"{name} is 1 or 0, not {value!r}")
            off = parameter.secondary_opts if parameter.default is True else []
            options += [option] if value in YES else off
        else:
            options += [f"{option}={word}" for word in (value.split() if name in SPLIT else [value])]
    return [*options, *(["--", *positional] if positional else [])]


def command_lines(target: Target, parameters: dict[str, Any], variables: dict[str, str]) -> list[list[str]]:
    """Return the command lines of a target, each behind the interpreter of the environment."""
    if target.command:
        unset = {target.instead[name] for name in variables if name in target.instead}
        own = {name: value for name, value in target.defaults.items() if name not in unset} | variables
        return [[python(), "-m", *target.command.split(), *arguments(parameters, own)]]
    lines = []
    for step in target.steps:
        words: list[str] = [python()]
        for word in shlex.split(step):
            words += shlex.split(variables.get(word[1:], "")) if word.startswith("$") else [word]
        lines.append(words)
    return lines


def main() -> None:
    """Run a target."""
    flags = os.environ.get("MAKEFLAGS", "")
    name = sys.argv[1]
    if name not in TARGETS:
        _fail(f"there is no target {name}{_nearest(name, list(TARGETS))}")
    try:
        _make(name, TARGETS[name], typed_variables(flags), _letters(flags))
    except SetupError as error:
        _fail(str(error))
    except KeyboardInterrupt:
        sys.exit(130)


def _make(name: str, target: Target, variables: dict[str, str], letters: str) -> None:
    """Check the variables as early as the packages allow, install what is missing, and run the target."""
    target, variables, own = _switched(target, variables)
    if name in ("help", "clean"):
        check_variables(name, variables, [])
        print_help() if name == "help" else _clean("n" in letters)
        return
    wanted = groups() if target.needs == ALL else [BASE, *target.needs]
    wanted += [group for pair, group in GROUP_OF.items() if pair in variables.items() and group not in wanted]
    dry = "n" in letters
    if not target.command:  # its variables are known without any package
        check_variables(name, variables, list(options_of(target)))
    elif missing([BASE]) and not dry:
        install(wanted)
    if target.command and os.path.exists(python()) and INSIDE not in sys.argv:
        os.execv(python(), [python(), "-m", "model.cli.make", name, INSIDE])
    parameters = _options(target, [] if dry else wanted)
    check_variables(name, variables, [*parameters, *own])
    lines = command_lines(target, parameters, variables)
    if dry:
        print("\n".join(shlex.join(line) for line in lines))
        return
    install(wanted)
    if target.apart:
        install_apart(target.apart)
    for line in lines:
        _call(line)


def _switched(target: Target, variables: dict[str, str]) -> tuple[Target, dict[str, str], list[str]]:
    """Return the target that the switches choose, the variables without them, and their names."""
    chosen, left = target, dict(variables)
    for name, other in target.switches.items():
        value = left.pop(name, NO[0])
        if value not in YES + NO:
            _fail(f"{name} is 1 or 0, not {value!r}")
        chosen = other if value in YES else chosen
    return chosen, left, list(target.switches)


def _options(target: Target, wanted: list[str]) -> dict[str, Any]:
    """Return the parameters of a target; a command that does not load without its group gets it first."""
    try:
        return options_of(target)
    except ModuleNotFoundError:
        if not missing(wanted):
            raise
        install(wanted)
        return options_of(target)


def _call(line: list[str]) -> None:
    """Run a command line without what make has put into the environment; leave with its exit code if it fails."""
    outer = {k: v for k, v in os.environ.items() if k not in ("MAKEFLAGS", "MFLAGS", "MAKEOVERRIDES", "MAKELEVEL")}
    process = subprocess.Popen(line, env=outer | ENVIRONMENT)
    while True:
        try:
            code = process.wait()
            break
        except KeyboardInterrupt:  # the command hears it too, and ends in its own way
            continue
    if code:
        sys.exit(code if code > 0 else 128 - code)


def print_help() -> None:
    """Print the targets, and what all of them have in common."""
    width = max(map(len, TARGETS)) + 2
    print("make TARGET [VARIABLE=value ...]")
    for name, target in TARGETS.items():
        print(f"  {name:<{width}}{target.help}")
    print(
        "\nA variable is an option of the target's command: ROWS=12 is --rows 12, WAVES=1 is --waves. Every option\n"
        "has one; a wrong name is refused. python -m model|rtl|flow|cocotb_tests|snn COMMAND --help lists them.\n"
        "Example: make sim ROWS=12 COLUMNS=16 ENCODING=nlcs RESOLUTION=6 SIM=icarus WAVES=1"
    )


def _clean(dry: bool) -> None:
    """Remove what was built, and the recorded scans that trainings keep."""
    clear = [python(), "-m", "snn", "cache", "--clear"]
    if dry:
        print(shlex.join(clear), shlex.join(["rm", "-r", *BUILT]), sep="\n")
        return
    if os.path.exists(python()):
        subprocess.run(clear, check=False)
    for folder in BUILT:
        shutil.rmtree(folder, ignore_errors=True)


def _letters(flags: str) -> str:
    """Return the one-letter flags of make."""
    first = flags.split(" ")[0]
    return "" if first.startswith("-") or "=" in first else first


def _nearest(word: str, known: list[str]) -> str:
    """Return the question for the known word that is most like another; one that begins alike is preferred."""
    if not known:
        return "; it takes no variable"

    def likeness(other: str) -> float:
        start = next((i for i, (a, b) in enumerate(zip(word, other, strict=False)) if a != b), 0)
        return difflib.SequenceMatcher(None, word, other).ratio() + 0.1 * start

    return f"; did you mean {max(known, key=likeness)}?"


def _fail(sentence: str) -> NoReturn:
    print(f"error: {sentence}", file=sys.stderr)
    sys.exit(EXIT_INPUT_ERROR)


if __name__ == "__main__":
    main()
