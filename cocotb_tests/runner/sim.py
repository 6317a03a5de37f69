"""Run the command sim: simulate scenarios and scans of textures, or a user's recordings."""

import dataclasses
import itertools
import re
import shlex
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.configuration import option_of
from eskin.base.errors import InputError
from eskin.base.files import atomic_write, make_folder
from eskin.base.progress import reported
from eskin.base.workers.engine import Local, each
from eskin.cocotb_tests.bench.stimuli import scenario_count, settled
from eskin.cocotb_tests.runner.chunk import Scans, retry_after_crash
from eskin.cocotb_tests.runner.cocotb_runners import Simulator
from eskin.cocotb_tests.runner.inputs import Inputs, Textures, named
from eskin.cocotb_tests.runner.process import Tally, play_runs, scenario_runs
from eskin.cocotb_tests.runner.reproduce import options, reproduce
from eskin.cocotb_tests.runner.simulator import build, is_built, require_programs
from eskin.model.address_events import Events
from eskin.model.config import NO_LOGIC, ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.model.readout import simulate
from eskin.rtl.delivery import ports
from eskin.rtl.gates.clock_gates import TEST
from eskin.rtl.text.slang import Port, ports_of, read_verilog
from eskin.skin.recordings.quality import link_warning
from eskin.skin.textures.dataset import open_dataset
from eskin.skin.textures.physical import PhysicalScan

PICTURE = "raster.png"
ALL_TICKS = 10**6  # more than any scan has: WAVES=1 alone would cut the scan short of the mismatch
WAVE_TICKS = 200
"""Default number of sample ticks of a scan with a waveform, or in the slow simulator."""


@dataclass(frozen=True)
class Plan:
    """The runs of every configuration."""

    simulator: Simulator
    waves: bool  # whether a waveform is left
    material: Inputs
    names: list[str]  # of the textures or recordings
    ticks: int | None  # sample ticks of a scan at most
    out: Path  # folder for pictures and event files
    scenarios: bool = False
    seed: int = 0  # of the scenarios
    text: str = ""  # Verilog to play instead of the configuration's own: a netlist with its cells, or a user's readout
    repeat_options: str = ""  # options for that text; empty without one
    macros: dict[str, str] | None = None  # further macros of the harness, for a user's readout
    command: str = "sim"  # command that simulates the text

    def runs(self, config: ReadoutConfig) -> int:
        """Return the number of runs of a configuration."""
        return (scenario_count(config) if self.scenarios else 0) + len(self.names)

    def place(self, config: ReadoutConfig) -> Path:
        """Return the folder of a configuration."""
        name = f"{config.rows}x{config.columns}-{config.encoding}-{config.resolution}b"
        return self.out / (name if self.material.preset else f"{self.material.name}-{name}")

    def running(self, config: ReadoutConfig) -> Path:
        """Return the working folder of the simulation."""
        return self.place(config) / "run"

    def samples(self, config: ReadoutConfig, name: str) -> NDArray[np.int32]:
        """Return the codes of a scan or recording, shape (ticks, taxels)."""
        array = self.material.array(name, config)
        return (PhysicalScan().samples(config, array)[0] if self.material.preset else array)[: self.ticks]

    def warning(self, config: ReadoutConfig) -> str:
        """Return a warning about link losses for the first scan; empty without losses."""
        return link_warning(config, self.samples(config, self.names[0])) if self.names else ""

    def picture(self, config: ReadoutConfig) -> Path | None:
        """Return the path of the picture of the first scan, or None without scans."""
        return self.place(config) / PICTURE if self.names else None

    def waveform(self, config: ReadoutConfig) -> Path:
        """Return the path of the waveform of a configuration."""
        return self.running(config) / ("waves.vcd" if self.simulator == "verilator" else "waves.fst")

    def reproduce(self, config: ReadoutConfig) -> str:
        """Return the command that repeats the runs of a configuration."""
        material = self.material
        if not material.preset:
            return " ".join(
                ["eskin sim", *options(config), *material.repeat_options, f"--ticks {self.ticks or ALL_TICKS}"]
            )
        repeat_command = " ".join(
            [reproduce(config, self.simulator, self.seed, self.command), *filter(None, [self.repeat_options])]
        )
        if not self.names:
            return repeat_command
        dataset = shlex.quote(str(material.place or material.name))
        return f"{repeat_command.replace(' --textures 0', '')} --dataset {dataset} --ticks {self.ticks or ALL_TICKS}"


def plan(
    simulator: str,
    waves: bool,
    seed: int,
    textures: int,
    only: str | None,
    ticks: int | None,
    dataset: str | None,
    out: Path,
) -> Plan:
    """Return the plan for textures."""
    require_programs(simulator)  # type: ignore[arg-type]
    if textures < 0 or seed < 0 or (ticks is not None and ticks < 1):
        raise InputError(f"textures and seed must be at least 0 and ticks at least 1, not {textures}, {seed}, {ticks}")
    data = open_dataset(dataset or "embedded")
    material = Textures(data, dataset or "embedded")
    labels = data.labels
    of_each_class = sorted(range(len(labels)), key=lambda i: (sum(labels[:i] == labels[i]), labels[i]))
    picked = [data[number].name for number in of_each_class[:textures]]
    if only is not None:
        picked = [named(material, only)]
    if ticks is None and (waves or simulator == "icarus"):
        ticks = WAVE_TICKS
    return Plan(simulator, waves, material, picked, ticks, out, only is None, seed)  # type: ignore[arg-type]


def check_own(simulator: str, count: int, ticks: int | None) -> None:
    """Check the simulation parameters before recordings are read."""
    require_programs(simulator)  # type: ignore[arg-type]
    if count < 1 or (ticks is not None and ticks < 1):
        raise InputError(f"textures and ticks must be at least 1 with --data, not {count}, {ticks}")


def with_dut(plan: Plan, config: ReadoutConfig, files: Sequence[Path], top: str) -> Plan:
    """Return a plan that simulates a user's readout instead of the RTL.

    ``files`` are all Verilog of the readout, and ``top`` is its module with the ports of the delivered Verilog. A port
    that is missing, has another direction or width, or is an unknown input is an InputError.
    """
    text = "\n".join(map(read_verilog, files))
    found = ports_of(text, top)
    macros = {"READOUT": top} | ({"TEST_ENABLE": "1"} if TEST in found else {})
    names = " ".join(f"--dut {shlex.quote(str(file.absolute()))}" for file in files)
    plan = dataclasses.replace(plan, text=text, repeat_options=f"{names} --top {top}", macros=macros)
    if not found:
        return plan
    wanted = {port["name"]: Port(port["direction"], port["width"]) for port in ports(config)}
    wrong = [
        f"has {name} ({found[name]}) in place of ({port})" if name in found else f"lacks {name} ({port})"
        for name, port in wanted.items()
        if found.get(name) != port
    ]
    more = sorted(name for name, port in found.items() if name not in wanted and port.direction != "output")
    wrong += [f"has the unknown {found[name].direction} {name}" for name in more if name != TEST]
    if wrong:
        raise InputError(
            f"as a readout of {config.rows} x {config.columns} taxels with {config.encoding} and link {config.link}, "
            f"module {top} {', '.join(wrong)}; give the configuration of your Verilog, for example with --config "
            f"eskin_readout.json, or write a wrapper and name it with --top"
        )
    return plan


def configuration_hint(config: ReadoutConfig) -> str:
    """Return the configuration to which a user's readout is compared, as options."""
    names = config.to_dict().keys() - {*config.idle_fields, *NO_LOGIC, "receptive_fields"}
    chosen = (field for field in dataclasses.fields(config) if field.name in names)
    held = " ".join(f"{option_of(field)} {getattr(config, field.name)}" for field in chosen)
    return f"the model has {held}; if your Verilog has another configuration, give its options or --config FILE.json"


@contextmanager
def built_ahead(plan: Plan, configs: Iterable[ReadoutConfig]) -> Iterator[Callable[[ReadoutConfig], None]]:
    """Build the missing programs in processes, while earlier ones play; yield a function that waits for a program."""
    missing = [config for config in configs if not is_built(config, plan.simulator, plan.waves)]
    if len(missing) < 2:
        yield lambda config: None
        return
    with Local() as pool:
        built = each(pool, _build, ((config, plan.simulator, plan.waves) for config in missing))

        def wait(config: ReadoutConfig) -> None:
            while config in missing:
                next(built)
                missing.pop(0)

        yield wait


def _build(config: ReadoutConfig, simulator: Simulator, waves: bool) -> None:
    build(config, simulator, waves=waves)


def play(
    plan: Plan,
    config: ReadoutConfig,
    on_run: Callable[[Any], None],
    on_stage: Callable[[str], None],
    wait: Callable[[ReadoutConfig], None] = lambda config: None,
) -> Tally:
    """Simulate all runs of a configuration, and return the totals.

    ``on_run`` is called with each finished run, and ``on_stage`` with what begins. ``wait`` waits for a program that is
    being built. A user's Verilog that cannot be built, or that ends the simulation, is an InputError.
    """
    on_stage(f"building for {plan.simulator}")
    with reported(f"building {config.rows} x {config.columns} taxels for {plan.simulator}"):
        wait(config)
        program = build(config, plan.simulator, waves=plan.waves, text=plan.text, macros=plan.macros)
    repeat_command = plan.reproduce(config)
    own = {"ticks": plan.ticks, "skip": plan.names[1:]}
    scans = Scans.of(plan.material, plan.names, config, program, re.sub(" --seed [0-9]+", "", repeat_command), **own)
    on_stage("RTL against model")
    place = plan.place(config).relative_to(plan.out)
    keep = make_folder(plan.out, place / "events").resolve()
    folder = make_folder(plan.out, place / "run", empty=True)
    scenarios = scenario_runs(config, plan.seed, repeat_command) if plan.scenarios else ()
    try:
        tally = play_runs(program, itertools.chain(scenarios, scans.runs(keep)), folder, on_run)
    except AssertionError:
        if plan.macros is None:
            raise
        raise InputError(f"the simulation of the Verilog ended early; look for $finish, and see {folder}") from None
    if plan.names:
        on_stage("picture")
        name = plan.names[0]
        image = plan.material.array(name, config) if plan.material.preset else None
        draw(config, name, plan.samples(config, name), plan.place(config), image)
    on_stage("done")
    return tally


def draw(config: ReadoutConfig, name: str, samples: NDArray[Any], folder: Path, texture: Any = None) -> None:
    """Draw the events of RTL and model above each other, and write both event files.

    ``samples``, shape (ticks, taxels), are the codes that were played, and ``texture`` is the image that was scanned.
    """
    from eskin.skin.figures.raster import plot_comparison

    recorded = folder / "events" / f"{name}.npz"
    rtl = Recording.load(recorded)
    model = simulate(config, settled(config, samples))
    metadata = rtl.metadata | {"source": "model"}
    Recording(model, config, rtl.duration_clocks, metadata=metadata).save(folder / "model.npz")
    with atomic_write(folder / "rtl.npz") as file:
        file.write(recorded.read_bytes())
    plot_comparison(
        (rtl.events, model),
        config,
        folder / PICTURE,
        labels=("RTL", "model"),
        title=f"{name}, {config.encoder.title} {config.resolution} b, {config.rows} x {config.columns} taxels",
        signal=samples / config.full_scale,
        texture=texture,
        duration_clocks=rtl.duration_clocks,
    )


def play_samples(config: ReadoutConfig, codes: NDArray[np.int32], simulator: Simulator = "verilator") -> Events:
    """Return the RTL's events for codes, shape (ticks, taxels), after comparison with the model."""
    program, repeat_command = build(config, simulator), " ".join(["eskin sim", *options(config)])

    def play(folder: Path) -> Events:
        play_runs(
            program, Scans(config, {"signal": codes}, repeat_command, {"signal": {"proof": ""}}).runs(folder), folder
        )
        return Recording.load(folder / "signal.npz").events

    events = retry_after_crash("signal", play)
    return events[events["t"] < len(codes) * config.clocks_per_sample]
