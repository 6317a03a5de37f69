"""Compare the speed of co-simulation and cycle model with a bare Verilator loop and a usual testbench.

All play the same samples through the same Verilog and must give the same number of events. Times are processor time,
because other work may use the machine; each round plays all contenders one after the other in one process.
"""

import json
import os
import statistics
import subprocess
import time
from pathlib import Path
from typing import Annotated, Any

import cocotb
import numpy as np
import typer
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge
from measure import JOB, MEASURED, RESULTS, JsonFile, in_simulator, spread, timed, versions, write

from eskin.base.files import digest
from eskin.cocotb_tests.bench.readout import Bench
from eskin.cocotb_tests.bench.textures import scan
from eskin.cocotb_tests.runner.build_cache import BUILD
from eskin.cocotb_tests.runner.cocotb_runners import VERILATOR_FLAGS, build_environment
from eskin.cocotb_tests.runner.simulator import build
from eskin.model.config import ReadoutConfig
from eskin.model.readout import Stimulus, simulate

TEXTURE, TICKS_PER_CLOCK_TEST = 0, 150
ENCODERS = ("lcs", "cw-lcs", "nlcs")
BARE, ALL, SKIPPING, EVERY, MODEL = (
    "bare Verilator loop (C++)",
    "co-simulation (harness), every clock",
    "co-simulation (harness), idle clocks skipped",
    "testbench waking every clock",
    "cycle-accurate model",
)
BARE_LOOP = Path(__file__).with_name("bare_loop.cpp").read_text()


def _config(encoding: str) -> ReadoutConfig:
    return ReadoutConfig(encoding=encoding)  # type: ignore[arg-type]


def _stimulus(config: ReadoutConfig, scene: str, ticks: int | None = None) -> Stimulus:
    """Return a texture scan; ``scene="rest"`` repeats its middle sample."""
    samples = scan(config.rows, config.columns, config.sample_bits, TEXTURE)[:ticks]
    if scene == "rest":
        samples = np.repeat(samples[len(samples) // 2][None], len(samples), axis=0)
    return Stimulus.from_samples(config, samples)


# -- inside the simulator ----------------------------------------------------------------------------


@cocotb.test()
async def whole_runs(dut: Any) -> None:
    """Measure the times of harness, bare loop and model, from the samples to the events in memory."""
    job = json.loads(os.environ[JOB])
    config = _config(job["encoding"])
    bench = Bench(dut, config, Path.cwd())
    found = []
    for scene in ("texture", "rest"):
        stimulus = _stimulus(config, scene)
        for skip in (False, True):  # RTL and model are equal; the model is compiled
            await bench.check(scene, stimulus, skip)
        _write_words(config, stimulus, Path("samples.bin"))
        for _ in range(job["rounds"]):
            run = json.loads(subprocess.run([*job["bare"], "samples.bin"], check=True, capture_output=True).stdout)
            took = {BARE: (run["events"], run["seconds"])}
            for name, skip in ((ALL, False), (SKIPPING, True)):
                start = time.process_time()
                events = await bench.play(stimulus, skip)
                took[name] = (len(events), time.process_time() - start)
            events, seconds = timed(simulate, config, stimulus)
            took[MODEL] = (len(events), seconds)
            if len({count for count, _ in took.values()}) > 1:
                raise AssertionError(f"different numbers of events: {took}")
            clocks = {name: stimulus.clocks / seconds for name, (_, seconds) in took.items()}
            found.append({"scene": scene, "events": len(events), "clocks": stimulus.clocks, "per_second": clocks})
    MEASURED.write_text(json.dumps(found))


@cocotb.test()
async def every_clock(dut: Any) -> None:
    """Time a testbench of the usual kind: Python drives and samples in every clock."""
    config = _config("lcs")
    stimulus = _stimulus(config, "texture", TICKS_PER_CLOCK_TEST)
    weights = 1 << (np.arange(config.taxels, dtype=object) * config.sample_bits)
    words = [int(((row & (1 << config.sample_bits) - 1).astype(object) * weights).sum()) for row in stimulus.samples]
    dut.rst.value = 1
    dut.sample_valid.value = 0
    dut.event_ready.value = 1
    dut.taxel_enable.value = (1 << config.taxels) - 1
    cocotb.start_soon(Clock(dut.clk, 10, unit="ns").start())
    for _ in range(4):
        await FallingEdge(dut.clk)
    dut.rst.value = 0
    events = 0
    start = time.process_time()
    for word in words:
        dut.sample.value = word
        for clock in range(config.clocks_per_sample):
            dut.sample_valid.value = int(clock == 0)
            await FallingEdge(dut.clk)
            if dut.event_valid.value:
                events += 1
                _ = (dut.event_row.value, dut.event_col.value, dut.event_polarity.value)
    seconds = time.process_time() - start
    if events != len(simulate(config, stimulus)):
        raise AssertionError(f"the usual testbench counted {events} events, the model a different number")
    MEASURED.write_text(json.dumps(stimulus.clocks / seconds))


# -- outside -----------------------------------------------------------------------------------------


def _write_words(config: ReadoutConfig, stimulus: Stimulus, path: Path) -> None:
    """Write samples as words of 32 bits for the bare loop."""
    samples = stimulus.samples.astype(np.int64)
    bits = (samples[:, :, None] >> np.arange(config.sample_bits)) & 1
    flat = np.pad(bits.reshape(len(samples), -1), ((0, 0), (0, -config.taxels * config.sample_bits % 32)))
    path.write_bytes(np.packbits(flat.astype(np.uint8), axis=1, bitorder="little").tobytes())


def _bare_program(config: ReadoutConfig) -> list[str]:
    """Build the bare loop with the flags of the co-simulation, and return its command without the samples."""
    program = build(config, "verilator")
    folder = BUILD / "bench" / f"bare-{digest([program.folder.name, BARE_LOOP])}"
    executable = folder / "Veskin_readout"
    folder.mkdir(parents=True, exist_ok=True)
    if not executable.exists():
        (folder / "main.cpp").write_text(BARE_LOOP)
        flags = [flag for flag in VERILATOR_FLAGS if flag != "--timing"]
        command = ["verilator", "--cc", "--exe", "--build", *flags, "--top-module", "eskin_readout", "--Mdir", "."]
        with build_environment():
            subprocess.run(
                [*command, str(program.folder / "eskin_readout.v"), "main.cpp"],
                cwd=folder, check=True, stdout=subprocess.DEVNULL,
            )  # fmt: skip
    words = (config.taxels * config.sample_bits + 31) // 32
    return [str(executable), str(words), str(config.clocks_per_sample)]


def _row(encoding: str, scene: str, name: str, rates: list[float], reference: list[float]) -> dict[str, Any]:
    of_bare = spread([a / b for a, b in zip(rates, reference, strict=True)])
    print(f"{encoding:7} {scene:8} {name:46} " + "{median:7.3f} ({least:.3f}..{most:.3f})".format(**of_bare))
    said = {"name": f"{name}, {encoding}, {scene}", "contender": name, "encoding": encoding, "scene": scene}
    return said | {"clocks_per_second": statistics.median(rates), "of_bare_loop": of_bare}


def main(
    rounds: Annotated[int, typer.Option(help="rounds; every contender plays once in each")] = 7,
    out: JsonFile = RESULTS / "cosim.json",
) -> None:
    """Measure all candidates, check for equal events, print ratios to the bare loop, and write JSON."""
    rows, played = [], []
    for encoding in ENCODERS:
        config = _config(encoding)
        job = {"encoding": encoding, "rounds": rounds, "bare": _bare_program(config)}
        found = in_simulator(build(config, "verilator"), "cosim", "whole_runs", job)
        for scene in ("texture", "rest"):
            runs = [run for run in found if run["scene"] == scene]
            rates = {name: [run["per_second"][name] for run in runs] for name in runs[0]["per_second"]}
            if (encoding, scene) == ("lcs", "texture"):
                program = build(config, "verilator", top="eskin_readout", bare=True)
                rates[EVERY] = [in_simulator(program, "cosim", "every_clock", job) for _ in runs]
            rows += [_row(encoding, scene, name, values, rates[BARE]) for name, values in rates.items()]
            played.append({"encoding": encoding, "scene": scene} | {key: runs[0][key] for key in ("clocks", "events")})
    content = {"rounds": rounds, "played": played, "config": _config("lcs").to_dict(), "versions": versions("numpy")}
    write(out, "cosim", f"--rounds {rounds}", content | {"results": rows})


if __name__ == "__main__":
    typer.run(main)
