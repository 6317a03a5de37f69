"""Compare the speed of co-simulation and model with a bare Verilator loop and a clock-by-clock testbench.

All play the same texture scan through the same Verilog and must give the same number of events.
"""

from __future__ import annotations

import json
import os
import platform
import statistics
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import cocotb
import numpy as np
import typer
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge

from eskin.base.files import origin
from eskin.cocotb_tests.bench.readout import Bench
from eskin.cocotb_tests.bench.textures import scan
from eskin.cocotb_tests.runner.build_cache import BUILD
from eskin.cocotb_tests.runner.cocotb_runners import VERILATOR_FLAGS, build_environment
from eskin.cocotb_tests.runner.simulator import build
from eskin.model.config import ReadoutConfig
from eskin.model.readout import Stimulus, simulate

CONFIG = ReadoutConfig()
RESULTS = Path(__file__).parent / "results" / "cosim.json"
TEXTURE, TICKS_PER_CLOCK_TEST = 0, 150

BARE_LOOP = r"""
#include "Veskin_readout.h"
#include "verilated.h"
#include <chrono>
#include <cstdio>
#include <cstring>
#include <vector>
int main(int argc, char** argv) {
  const int words = atoi(argv[1]), clocks_per_sample = atoi(argv[2]);
  std::vector<uint32_t> samples;
  FILE* file = fopen("samples.bin", "rb");
  uint32_t word;
  while (fread(&word, 4, 1, file) == 1) samples.push_back(word);
  fclose(file);
  Veskin_readout top;
  top.clk = 0; top.rst = 1; top.event_ready = 1; top.sample_valid = 0;
  memset(&top.taxel_enable, 0xff, sizeof top.taxel_enable);
  for (int i = 0; i < 4; i++) { top.clk = 0; top.eval(); top.clk = 1; top.eval(); }
  top.rst = 0;
  const size_t ticks = samples.size() / words;
  uint64_t events = 0, sum = 0;
  auto start = std::chrono::steady_clock::now();
  for (size_t tick = 0; tick < ticks; tick++) {
    memcpy(&top.sample, &samples[tick * words], 4 * words);
    for (int clock = 0; clock < clocks_per_sample; clock++) {
      top.sample_valid = clock == 0;
      top.clk = 0; top.eval();
      if (top.event_valid) { events++; sum += 8 * top.event_row + top.event_col; }
      top.clk = 1; top.eval();
    }
  }
  std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  printf("{\"events\": %llu, \"sum\": %llu, \"seconds\": %.6f}\n", (unsigned long long)events,
         (unsigned long long)sum, seconds.count());
}
"""


def _stimulus(ticks: int | None = None) -> Stimulus:
    return Stimulus.from_samples(CONFIG, scan(CONFIG.rows, CONFIG.columns, CONFIG.sample_bits, TEXTURE)[:ticks])


# -- inside the simulator ----------------------------------------------------------------------------


@cocotb.test()
async def whole_runs(dut: Any) -> None:
    """Time runs of the harness, from samples to events in memory."""
    bench = Bench(dut, CONFIG, Path.cwd())
    stimulus = _stimulus()
    await bench.check("warm-up", stimulus)
    start = time.perf_counter()
    events, _ = await bench.play(stimulus)
    played = time.perf_counter() - start
    await bench.check("again", stimulus)
    Path("measured.json").write_text(json.dumps({"events": len(events), "seconds": played}))


@cocotb.test()
async def every_clock(dut: Any) -> None:
    """Time a common testbench, in which Python drives and samples in every clock."""
    stimulus = _stimulus(TICKS_PER_CLOCK_TEST)
    weights = 1 << (np.arange(CONFIG.taxels, dtype=object) * CONFIG.sample_bits)
    words = [int(((row & (1 << CONFIG.sample_bits) - 1).astype(object) * weights).sum()) for row in stimulus.samples]
    dut.rst.value = 1
    dut.sample_valid.value = 0
    dut.event_ready.value = 1
    dut.taxel_enable.value = (1 << CONFIG.taxels) - 1
    cocotb.start_soon(Clock(dut.clk, 10, unit="ns").start())
    for _ in range(4):
        await FallingEdge(dut.clk)
    dut.rst.value = 0
    events = 0
    start = time.perf_counter()
    for word in words:
        dut.sample.value = word
        for clock in range(CONFIG.clocks_per_sample):
            dut.sample_valid.value = int(clock == 0)
            await FallingEdge(dut.clk)
            if dut.event_valid.value:
                events += 1
                _ = (dut.event_row.value, dut.event_col.value, dut.event_polarity.value)
    seconds = time.perf_counter() - start
    Path("measured.json").write_text(json.dumps({"events": events, "seconds": seconds}))


# -- outside -----------------------------------------------------------------------------------------


def _bare_program() -> tuple[Path, int]:
    """Build the bare loop with the flags of the co-simulation; return it and the words per sample."""
    program = build(CONFIG, "verilator")
    folder = BUILD / "bench" / f"bare-{program.folder.name}"
    executable = folder / "Veskin_readout"
    words = (CONFIG.taxels * CONFIG.sample_bits + 31) // 32
    samples = _stimulus().samples.astype(np.int64)
    bits = (samples[:, :, None] >> np.arange(CONFIG.sample_bits)) & 1
    flat = np.pad(bits.reshape(len(samples), -1), ((0, 0), (0, words * 32 - CONFIG.taxels * CONFIG.sample_bits)))
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "samples.bin").write_bytes(np.packbits(flat.astype(np.uint8), axis=1, bitorder="little").tobytes())
    if not executable.exists():
        (folder / "main.cpp").write_text(BARE_LOOP)
        flags = [flag for flag in VERILATOR_FLAGS if flag != "--timing"]
        command = ["verilator", "--cc", "--exe", "--build", *flags, "--top-module", "eskin_readout", "--Mdir", "."]
        with build_environment():
            subprocess.run(
                [*command, str(program.folder / "eskin_readout.v"), "main.cpp"],
                cwd=folder, check=True, stdout=subprocess.DEVNULL,
            )  # fmt: skip
    return executable, words


def _in_simulator(testcase: str, bare: bool) -> Callable[[], dict[str, Any]]:
    program = build(CONFIG, "verilator", top="eskin_readout" if bare else "harness", bare=bare)

    def run() -> dict[str, Any]:
        with tempfile.TemporaryDirectory() as folder:
            program.test("cosim", Path(folder), testcase)
            measured: dict[str, Any] = json.loads((Path(folder) / "measured.json").read_text())
            return measured

    return run


def main(
    rounds: Annotated[int, typer.Option(help="rounds; every contender plays once in each")] = 7,
    out: Annotated[Path, typer.Option("--json", help="result file")] = RESULTS,
) -> None:
    """Run the benchmark, check for equal events, print a table and write JSON."""
    stimulus, short = _stimulus(), _stimulus(TICKS_PER_CLOCK_TEST)
    executable, words = _bare_program()

    def bare() -> dict[str, Any]:
        command = [str(executable), str(words), str(CONFIG.clocks_per_sample)]
        done = subprocess.run(command, cwd=executable.parent, check=True, capture_output=True, text=True)
        result: dict[str, Any] = json.loads(done.stdout)
        return result

    def model() -> dict[str, Any]:
        start = time.perf_counter()
        events = simulate(CONFIG, stimulus)
        return {"events": len(events), "seconds": time.perf_counter() - start}

    simulate(CONFIG, stimulus)  # compiles
    contenders: dict[str, tuple[int, Callable[[], dict[str, Any]]]] = {
        "bare Verilator loop (C++)": (stimulus.clocks, bare),
        "co-simulation (harness)": (stimulus.clocks, _in_simulator("whole_runs", bare=False)),
        "testbench waking every clock": (short.clocks, _in_simulator("every_clock", bare=True)),
        "cycle-accurate model": (stimulus.clocks, model),
    }
    expected = {stimulus.clocks: len(simulate(CONFIG, stimulus)), short.clocks: len(simulate(CONFIG, short))}
    rates: dict[str, list[float]] = {name: [] for name in contenders}
    for number in range(rounds):
        for name, (clocks, run) in contenders.items():
            result = run()
            if result["events"] != expected[clocks]:
                raise SystemExit(f"{name} saw {result['events']} events, the model {expected[clocks]}")
            rates[name].append(clocks / result["seconds"])
        print(f"round {number + 1} of {rounds}", end="\r", flush=True)
    reference = rates["bare Verilator loop (C++)"]
    rows = []
    print(f"{'':32}  {'M clocks/s':>10}  of the bare loop (least..most)")
    for name, values in rates.items():
        ratios = [a / b for a, b in zip(values, reference, strict=True)]
        rows.append(
            {
                "name": name,
                "clocks_per_second": statistics.median(values),
                "of_bare_loop": {"median": statistics.median(ratios), "least": min(ratios), "most": max(ratios)},
            }
        )
        print(
            f"{name:32}  {statistics.median(values) / 1e6:10.3f}  "
            f"{statistics.median(ratios):.3f} ({min(ratios):.3f}..{max(ratios):.3f})"
        )
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(
        json.dumps(
            origin(f"python benchmarks/cosim.py --rounds {rounds}")
            | {
                "benchmark": "cosim",
                "rounds": rounds,
                "clocks": stimulus.clocks,
                "events": expected[stimulus.clocks],
                "config": CONFIG.to_dict(),
                "versions": {"python": platform.python_version(), "numpy": np.__version__, "cpus": os.cpu_count()},
                "results": rows,
            },
            indent=2,
        )
        + "\n"
    )
    print(out)


if __name__ == "__main__":
    typer.run(main)
