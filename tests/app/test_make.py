"""Test make: variables reach the programs unchanged, and invalid variables are rejected."""

import fcntl
import os
import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from eskin.app import setup
from eskin.app.catalogue import COMMANDS, words_of
from eskin.app.make import (
    OWN,
    STEPS,
    SWITCHES,
    TARGETS,
    needs_of,
    options_of,
    typed_variables,
)
from eskin.app.make import _call as run_line
from eskin.app.uv import SetupError, build_of_torch, uv
from tests.test_layers import ROOMS

ROOT = Path(__file__).parents[2]

Make = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """Return a folder like the checkout, with a complete environment."""
    for name in ("Makefile", "pyproject.toml", "constraints.txt", "eskin", *ROOMS):
        (tmp_path / name).symlink_to(ROOT / name)
    venv = tmp_path / ".venv"
    venv.mkdir()
    for path in Path(sys.prefix).iterdir():
        if not path.name.startswith("."):
            (venv / path.name).symlink_to(path)
    return tmp_path


@pytest.fixture
def make(checkout: Path, monkeypatch: pytest.MonkeyPatch) -> Make:
    """Return a function that runs make in that folder."""
    monkeypatch.chdir(checkout)
    for group in setup.groups():
        setup._stamp(group).write_text(setup._digest(group))
    outer = {k: v for k, v in os.environ.items() if not k.startswith(("MAKE", "MFLAGS", "ESKIN"))}
    environment = outer | {"COLUMNS": "132", "PYTHONPATH": str(checkout)}

    def make(*words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(["make", *words], capture_output=True, text=True, env=environment, cwd=checkout)

    return make


@pytest.fixture
def launch(make: Make, dry_make: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that makes a target as a dry run in that folder, and returns its commands without Python."""

    def launch(target: str, *variables: str) -> tuple[int, list[list[str]], str]:
        code, lines, err = dry_make(target, *variables)
        return code, [line[1:] for line in lines], err

    return launch


HOSTILE = {
    "OUT": "it's",
    "ONLY": "$(touch bad)",
    "DATASET": "$(shell touch bad)",
    "CONFIG": "`touch bad`",
    "LINK": "'; touch bad; '",
    "RESET": 'a  "b" \\ c',
    "TAU": "-x",
    "SIM": "$$HOME",
    "ENCODING": "a=b -- ROWS=3",
}


def test_variables_arrive_as_typed(make: Make, checkout: Path) -> None:
    done = make("-n", "sim", *(f"{name}={text}" for name, text in HOSTILE.items()))
    assert done.returncode == 0, done.stderr
    words = shlex.split(done.stdout.splitlines()[-1])
    assert words[:4] == [".venv/bin/python", "-m", "eskin", "sim"]
    assert sorted(words[4:]) == sorted(f"--{name.lower()}={text}" for name, text in HOSTILE.items())
    done = make("-n", "predict", f"WEIGHTS={HOSTILE['LINK']}")
    assert shlex.split(done.stdout.splitlines()[-1])[-2:] == ["--", HOSTILE["LINK"]]
    assert not (checkout / "bad").exists()


@pytest.mark.parametrize("target", ["power;touch bad", "$$(touch bad)", "`touch bad`", "it's'; touch bad; '", "a b"])
def test_a_target_is_no_command_of_the_shell(make: Make, checkout: Path, target: str) -> None:
    done = make("--", target)
    assert "error: there is no target " in done.stderr
    assert not (checkout / "bad").exists()


def test_a_real_run_writes_where_it_was_told(make: Make, checkout: Path) -> None:
    """Check that make, launcher and command pass a folder name unchanged."""
    text = "it's `touch bad` $(touch bad) $(shell touch bad) '; touch bad; '"
    done = make("-s", "explore", f"OUT=out/{text}")
    assert done.returncode == 0, done.stderr
    assert (checkout / "out" / text / "explore.png").is_file()
    assert not list(checkout.rglob("bad"))


def test_the_interpreter_is_a_name_too(make: Make, checkout: Path) -> None:
    for text in ("'; touch bad; '", "$(shell touch bad)", "none; touch bad"):
        done = make("-s", "lint", f"PYTHON={text}")
        assert done.stderr.startswith("error: Python 3.11 or newer not found; install with: apt-get install python3 ")
        assert done.returncode == 2
    assert not (checkout / "bad").exists()


@pytest.mark.quick
def test_make_refuses_a_wrong_variable(make: Make) -> None:
    done = make("-s", "verilog", "ROW=3")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.splitlines()[0] == "error: make verilog does not take ROW; did you mean ROWS?"
    done = make("-s", "simm")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.splitlines()[0] == "error: there is no target simm; did you mean sim?"


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("train DATUM=x", "make train does not take DATUM; did you mean DATA?"),
        ("sim ROWS=3 COLUMS=4", "make sim does not take COLUMS; did you mean COLUMNS?"),
        ("sim GATE=1", "make sim does not take GATE; did you mean GATES?"),
        ("sweep ENCODING=lcs", "make sweep does not take ENCODING; did you mean "),
        ("test ROWS=3", "make test does not take ROWS; did you mean PYTEST?"),
        ("lint ROWS=3", "make lint does not take ROWS; it takes no variable"),
        ("clean ROWS=3", "make clean does not take ROWS; it takes no variable"),
        ("help ROWS=3", "make help does not take ROWS; it takes no variable"),
        ("sim WAVES=perhaps", "WAVES is 1 or 0, not 'perhaps'"),
        ("sim GATES=on", "GATES is 1 or 0, not 'on'"),
    ],
)
def test_a_wrong_variable_is_one_sentence(launch: Callable[..., Any], words: str, sentence: str) -> None:
    code, lines, err = launch(*words.split())
    assert (code, lines) == (2, [])
    assert err.startswith(f"error: {sentence}")
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("sim COLUMNS=3", "sim --columns=3"),
        ("sim WAVES=0 GATES=0", "sim"),
        ("sim GATES=1 LIB=cells.lib ROWS=2", "gatesim --lib=cells.lib --rows=2"),
        ("asic LIB=cells.lib POWER=0", "asic --lib=cells.lib --no-power"),
        ("train 'SET=a=1 b=2'", "train --set=a=1 --set=b=2"),
        ("layout", "layout --rows=2 --columns=2"),
        ("layout ROWS=8 COMPARE=0", "layout --no-compare --rows=8 --columns=2"),
    ],
)
def test_variables_become_options(launch: Callable[..., Any], words: str, line: str) -> None:
    ((_, program, *options),) = launch(*shlex.split(words))[1]
    assert (program, options) == ("eskin", line.split())


def test_only_what_is_typed_counts(launch: Callable[..., Any], make: Make) -> None:
    done = make("-s", "-n", "-j2", "sim", "WAVES=1", "ROWS:=3", "PYTHON=python3")  # where COLUMNS is exported
    assert done.stdout.splitlines()[-1].endswith("-m eskin sim --waves --rows=3")
    assert launch("test", "PYTEST=-x -k 'a or b'")[1][0][-3:] == ["-x", "-k", "a or b"]
    assert launch("docs")[1][-1] == ["-c", 'print("out/site/index.html")']


def test_every_target_shows_its_command(launch: Callable[..., Any]) -> None:
    for name in TARGETS:
        code, lines, err = launch(name)
        assert (code, err) == (0, "")
        if name in COMMANDS:
            words = ["-m", "eskin", *words_of(name)]
            assert [line[: len(words)] for line in lines] == [words]
        elif name in STEPS:
            assert len(lines) == len(STEPS[name][1])


def test_a_target_runs_whatever_file_has_its_name(make: Make, checkout: Path) -> None:
    for name in ("sim", "power", "lint.o"):
        (checkout / name).unlink(missing_ok=True)
        (checkout / name).write_text("")
    assert make("-n", "lint.o").stderr.startswith("error: there is no target lint.o; did you mean lint?\n")
    done = make("-n", "sim", "lint")
    assert ".venv/bin/python -m eskin sim\n" in done.stdout
    assert done.stdout.endswith("\n.venv/bin/python -m mypy\n")


def test_the_help_lists_every_target_with_what_it_does(make: Make) -> None:
    listed = [line.split(maxsplit=1) for line in make().stdout.splitlines() if line.startswith("  ")]
    assert [name for name, _ in listed] == TARGETS
    assert all(len(text) > 10 for _, text in listed)


def test_declarations_name_groups_targets_and_variables() -> None:
    assert {group for found in COMMANDS.values() for group in found.needs.split()} <= set(setup.groups())
    assert not set(OWN) & set(COMMANDS)
    assert not set(STEPS) & set(COMMANDS)
    for (name, _), other in SWITCHES.items():
        assert {name, other} <= set(COMMANDS)
    for name, found in COMMANDS.items():
        assert {word.partition("=")[0] for word in found.variables.split()} <= set(options_of(name))


@pytest.mark.parametrize(
    ("flags", "variables"),
    [
        ("", {}),
        ("n", {}),
        ("-- A=1", {"A": "1"}),
        (r" -- B=a\ \\\ b A=$$x", {"A": "$x", "B": "a \\ b"}),
        ("kn -j2 --jobserver-auth=3,4 -- A= B+=2 C:=3 D::=4 E?=5", {"A": "", "B": "2", "C": "3", "D": "4", "E": "5"}),
        (r" -- A=x\ --\ B=2", {"A": "x -- B=2"}),
    ],
)
def test_variables_are_read_from_the_flags(flags: str, variables: dict[str, str]) -> None:
    assert typed_variables(flags) == variables


# -- groups of packages ------------------------------------------------------------------------------


@pytest.mark.parametrize("target", ["setup", "check", "test"])
def test_tests_need_every_group(target: str) -> None:
    assert needs_of(target, {}) == setup.groups()


@pytest.mark.parametrize(
    ("chosen", "wanted"),
    [
        ("sim", ["base", "sim"]),
        ("board lint", ["base", "board", "lint"]),
        ("convert", ["base", "events"]),
        ("cache", ["base"]),
        ("power train", ["base", "snn"]),
        ("lint pins", ["base", "lint", "dev"]),
    ],
)
def test_setup_installs_for_a_command_or_a_group(chosen: str, wanted: list[str]) -> None:
    assert needs_of("setup", {"FOR": chosen}) == wanted


def test_a_small_board_needs_its_tools() -> None:
    assert needs_of("fpga", {"BOARD": "icebreaker"}) == ["base", "fpga", "fpga-small"]
    assert needs_of("fpga", {"BOARD": "ulx3s-25f"}) == needs_of("fpga", {}) == ["base", "fpga"]


def test_setup_refuses_an_unknown_command_or_group(launch: Callable[..., Any]) -> None:
    code, lines, err = launch("setup", "FOR=sim trian")
    assert (code, lines) == (2, [])
    assert err == "error: there is no command or group trian; did you mean train?\n"


@pytest.fixture
def asked(checkout: Path, monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """Replace uv by a list of its command lines, in a folder like the checkout with an empty environment."""
    monkeypatch.chdir(checkout)
    (checkout / ".venv" / "bin").unlink()
    (checkout / ".venv" / "bin").mkdir()
    for program in ("python", "pip", "uv"):
        (checkout / ".venv" / "bin" / program).symlink_to("/bin/true")
    installed: list[list[str]] = []

    def install(command: list[str]) -> None:
        with open(checkout / ".venv" / ".lock", "w") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # as uv does, which would wait for five minutes
        installed.append(command)

    monkeypatch.setattr(setup, "install_packages", install)
    return installed


def test_groups_are_installed_when_what_they_are_made_of_changes(
    checkout: Path, asked: list[list[str]], capfd: pytest.CaptureFixture[str]
) -> None:
    assert setup.missing(setup.groups()) == setup.groups()
    setup.install(["base", "sim"])
    assert asked.pop()[-7:] == ["-c", "constraints.txt", "-r", "pyproject.toml", "--extra=sim", "-e", "."]
    assert setup.missing(setup.groups()) == [group for group in setup.groups() if group not in ("base", "sim")]
    setup.install(["base", "sim"])
    assert not asked
    setup.install(["base", "snn"])
    assert asked.pop()[-5:] == ["-r", "pyproject.toml", "--extra=snn", "-e", "."]
    (checkout / "constraints.txt").unlink()
    (checkout / "constraints.txt").write_text("numpy==1\n")
    assert "base" in setup.missing(["base"])
    megabytes = setup.SIZES["base"] + setup.SIZES["sim"]
    said = f"setting up .venv, only once: base, sim, {megabytes} MB of pinned packages\n"
    assert capfd.readouterr().out.startswith(said)


def test_a_failed_install_is_no_install(checkout: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(checkout)
    setup._stamp("base").write_text(setup._digest("base"))
    monkeypatch.setattr(setup, "uv", lambda python: ["/bin/false"])
    with pytest.raises(SetupError, match="the packages could not be installed; see the error above"):
        setup.install(["base", "snn"])
    assert setup.missing(["base", "snn"]) == ["snn"]


def test_an_environment_apart_is_made_once_and_again_when_its_pins_change(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    folder, pinned = setup.APART["layout"]
    pinned.parent.mkdir(parents=True)
    pinned.write_text("klayout==0.30.12\n")
    installed: list[list[str]] = []
    monkeypatch.setattr(setup.shutil, "which", lambda program: None)
    with pytest.raises(SetupError, match=r"^klayout not found; install with: apt-get install klayout$"):
        setup.install_apart("layout")  # before anything is downloaded
    assert not folder.exists()
    monkeypatch.setattr(setup.shutil, "which", lambda program: program)
    done = subprocess.CompletedProcess([], 0, "", "")
    monkeypatch.setattr(setup.subprocess, "run", lambda command, **options: done)
    monkeypatch.setattr(setup, "install_packages", installed.append)
    setup.install_apart("layout")
    setup.install_apart("layout")
    (command,) = installed
    assert command[:5] == [f"{folder}/bin/uv", "pip", "install", "--python", f"{folder}/bin/python"]
    assert command[-2:] == ["-r", str(pinned)]
    pinned.write_text("klayout==0.30.13\n")
    setup.install_apart("layout")
    assert len(installed) == 2
    assert not (tmp_path / ".venv").exists()


# -- uv ----------------------------------------------------------------------------------------------


def program(path: Path, text: str) -> None:
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)


def test_uv_takes_the_indexes_and_folders_of_pip(tmp_path: Path) -> None:
    said = """\
:env:.find-links='/mine'
global.cert='/store.crt'
global.extra-index-url='file:///a file:///b'
global.find-links='/theirs'
install.trusted-host='x\\ny'"""
    program(tmp_path / "python", f"cat <<'END'\n{said}\nEND")
    assert uv(str(tmp_path / "python"))[5:-1] == [
        *("--allow-insecure-host", "x", "--allow-insecure-host", "y", "--find-links", "/mine"),
        *("--index", "file:///a", "--index", "file:///b"),
    ]


NO_GPU, WITH_GPU = "+ torch==2.13.0+cpu", "+ nvidia-nvtx==13\n + torch==2.13.0"


@pytest.mark.parametrize(
    ("configured", "suited", "option", "said"),
    [
        ("+ numpy==2", "", [], ""),
        (NO_GPU, "", [], "PyTorch without libraries for GPUs: 0.2 GB to download"),
        (WITH_GPU, NO_GPU, ["--torch-backend=auto"], "PyTorch without libraries for GPUs: 0.2 GB to download"),
        (WITH_GPU, WITH_GPU, ["--torch-backend=auto"], "PyTorch with its libraries for GPUs: 2.7 GB to download"),
        (WITH_GPU, "", [], "PyTorch with its libraries for GPUs: 2.7 GB to download"),
    ],
)
def test_the_build_of_torch_suits_the_machine(
    tmp_path: Path, configured: str, suited: str, option: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Check an index with a CPU build, an index with builds for GPUs, and a network without the index of PyTorch."""
    answers = {"": configured, "auto": suited}
    for name, text in answers.items():
        (tmp_path / f"planned{name}").write_text(f" {text}\n" if text else "")
    program(
        tmp_path / "uv",
        f"""case "$*" in *--torch-backend=auto*) name=auto;; esac
        case "$*" in *--dry-run*) ;; *) exit 3;; esac
        test -s {tmp_path}/planned$name && cat {tmp_path}/planned$name >&2""",
    )
    assert build_of_torch([str(tmp_path / "uv"), "pip", "install"]) == option
    assert capsys.readouterr().out.startswith(said)


def test_processes_keep_bytecode_whatever_the_image_says(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    run_line([sys.executable, "-c", "import sys; sys.exit(sys.dont_write_bytecode)"])
