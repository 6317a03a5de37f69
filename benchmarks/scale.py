"""Measure generation, lint, build and simulation time against array size, and a skin of 65,536 taxels.

``python benchmarks/scale.py arrays``, ``... skins``, ``... tiles`` and ``... encoders``, each into a file of its own in
``benchmarks/results``.

Every array plays the start of a scan over an embedded photograph and is held to the model. Times are processor seconds
of the programs, so that other work on the machine counts little; Verilator's own library is compiled before.
"""

import json
import math
import multiprocessing
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated, Any, Literal

import cocotb
import numpy as np
import typer
from measure import JOB, MEASURED, RESULTS, JsonFile, in_simulator, measured, timed, write

from eskin.cocotb_tests.bench.readout import Bench, go, write_stimulus
from eskin.cocotb_tests.bench.textures import large_enough, scan
from eskin.cocotb_tests.runner import simulator as programs
from eskin.cocotb_tests.runner.cocotb_runners import Simulator, build_environment
from eskin.cocotb_tests.runner.simulator import build
from eskin.model.config import ReadoutConfig
from eskin.model.readout import Stimulus, simulate
from eskin.model.taxel import encode
from eskin.model.tiles.config import TilesConfig
from eskin.model.tiles.run import scan_skin, simulate_skin
from eskin.skin.textures.dataset import embedded_dataset
from eskin.skin.textures.physical import PhysicalScan

FLAT, SLOW = 16, 32
"""Largest side of arrays that are also built flat, and largest side of arrays that Icarus simulates."""
TICKS, SLOW_TICKS = 100, 6
RELAYS = 2
"""Relay stations on the line of each tile."""
LARGEST_SKIN = 4096
"""Taxels of the largest skin in one module; the number of input bits of a module is limited."""
TRAVEL_PX = 15
"""Distance in pixels that the skin slides over the image."""


# -- inside the simulator ----------------------------------------------------------------------------


@cocotb.test()
async def play(dut: Any) -> None:
    """Play a scan, compare it with the model, and time it again."""
    fields = json.loads(os.environ[JOB])
    config, ticks = ReadoutConfig.from_dict(fields["config"]), fields["ticks"]
    stimulus = Stimulus.from_samples(config, scan(config.rows, config.columns, config.sample_bits, 0)[:ticks])
    bench = Bench(dut, config, Path.cwd())
    events = await bench.check("scan", stimulus)
    start = time.process_time()
    write_stimulus(config, Path.cwd(), stimulus)
    written = time.process_time()
    await go(dut, skip=False)
    told = {"events": len(events), "clocks": stimulus.clocks, "write_s": written - start}
    MEASURED.write_text(json.dumps(told | {"simulation_s": time.process_time() - written}))


# -- outside -----------------------------------------------------------------------------------------


def _speed(config: ReadoutConfig, simulator: Simulator, ticks: int, hierarchical: bool) -> dict[str, Any]:
    """Build and simulate an array; return build seconds, clocks per second, and events."""
    result: dict[str, Any] = {"simulator": simulator, "row_by_row": hierarchical}
    kept = programs.BUILD
    with tempfile.TemporaryDirectory() as folder:
        programs.BUILD = Path(folder)
        try:
            with measured(result, "build_s"):
                program = build(config, simulator, hierarchical=hierarchical)
        finally:
            programs.BUILD = kept
        told = in_simulator(program, "scale", "play", {"config": config.to_dict(), "ticks": ticks})
    result["clocks_per_second"] = told["clocks"] / told["simulation_s"]
    result["stimulus_share"] = told["write_s"] / (told["write_s"] + told["simulation_s"])
    return result | {"clocks": told["clocks"], "events": told["events"]}


def array(side: int) -> dict[str, Any]:
    """Return all measurements of a square array."""
    config = ReadoutConfig(rows=side, columns=side)
    result: dict[str, Any] = {"side": side, "taxels": config.taxels}
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "eskin", "verilog", "--rows", str(side), "--columns", str(side), "-o", folder]
        with measured(result, "generate_s"):
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        text = Path(folder) / "eskin_readout.v"
        result["verilog_bytes"] = text.stat().st_size
        with build_environment(), measured(result, "lint_s"):
            subprocess.run(["verilator", "--lint-only", "-Wall", str(text)], check=True, stdout=subprocess.DEVNULL)
    runs: list[tuple[Simulator, int, bool]] = [("verilator", TICKS, True)]
    if side <= FLAT:
        runs.append(("verilator", TICKS, False))
    if side <= SLOW:
        runs.append(("icarus", SLOW_TICKS, False))
    result["simulations"] = [_speed(config, simulator, ticks, rows) for simulator, ticks, rows in runs]
    return result


def _scanned(config: TilesConfig) -> list[Stimulus]:
    """Return the stimulus of every tile for the start of a scan over an embedded photograph."""
    width = math.ceil(PhysicalScan().taxel_pitch_px * (config.columns - 1)) + TRAVEL_PX
    image = large_enough(embedded_dataset()[0].load(), config)[:, :width]
    return scan_skin(config, PhysicalScan(), image)


def skin(resolution: int, clocks_per_sample: int) -> dict[str, Any]:
    """Return the results of 16 tiles of 64 x 64 taxels with one merge."""
    tile = ReadoutConfig(rows=64, columns=64, resolution=resolution, clocks_per_sample=clocks_per_sample)
    config = TilesConfig.of(tile, 4, 4)
    stimuli = _scanned(config)
    events, seconds = timed(simulate_skin, config, stimuli)
    alone = [len(simulate(tile, stimulus)) for stimulus in stimuli]
    counts = np.bincount(config.in_tiles(events)[0], minlength=config.tiles)
    clocks = stimuli[0].clocks
    return {
        "taxels": config.taxels,
        "resolution": resolution,
        "clock_hz": config.clock_hz,
        "clocks": clocks,
        "events": len(events),
        "events_of_tiles_alone": sum(alone),
        "offered_per_clock": sum(alone) / clocks,
        "events_per_clock": len(events) / clocks,
        "fewest_of_a_tile": int(counts.min()),
        "most_of_a_tile": int(counts.max()),
        "bubbles_while_busy": int(events["t"][-1] - events["t"][0]) + 1 - len(events),
        "model_s": round(seconds, 2),
    }


def tiles_of(side: int, rows: int, columns: int) -> dict[str, Any]:
    """Return the times of generation and cycle-accurate model for a skin of tiles with relay stations.

    The model plays the start of a scan after a first run that fills its caches. The time includes neither samples nor
    cache.
    """
    tile = ReadoutConfig(rows=side, columns=side)
    config = TilesConfig.of(tile, rows, columns, RELAYS)
    result: dict[str, Any] = {"taxels": config.taxels, "tiles": config.tiles, "side": side}
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "eskin", "verilog", "--rows", str(side), "--columns", str(side)]
        command += ["-o", folder]
        skin = ["--tiles", f"{rows}x{columns}"]
        whole = config.taxels <= LARGEST_SKIN  # else a tile, and the merge for tiles that are chips
        with measured(result, "generate_s"):
            for more in ([*skin, "--relays", str(RELAYS)],) if whole else ([], [*skin, "--merge"]):
                subprocess.run([*command, *more], check=True, stdout=subprocess.DEVNULL)
        result["verilog_bytes"] = sum(text.stat().st_size for text in Path(folder).glob("*.v"))
    stimuli = _scanned(config)
    simulate_skin(config, stimuli)
    events, seconds = timed(simulate_skin, config, stimuli)
    result["model_s"] = round(seconds, 3)
    clocks = stimuli[0].clocks
    result["model_ns_per_taxel_tick"] = 1e9 * result["model_s"] / (config.taxels * clocks / tile.clocks_per_sample)
    return result | {"clocks": clocks, "events": len(events)}


def _second(config: ReadoutConfig, image: Any) -> Any:
    """Return the samples of one second over an image, to and fro, shape (ticks, taxels)."""
    ticks, samples = int(config.sample_rate_hz), PhysicalScan().samples(config, image)[0].astype(np.int16)
    return np.resize(np.concatenate([samples, samples[-2:0:-1]]), (ticks, config.taxels))


def _encode(job: tuple[ReadoutConfig, list[str]]) -> tuple[float, int]:
    """Return the processor seconds of the functional model for the tiles of one process, and their events.

    Each tile is encoded three times; the median counts.
    """
    config, names = job
    images = {texture.name: texture for texture in embedded_dataset()}
    counts = np.zeros((int(config.sample_rate_hz), config.taxels), np.int16)
    encode(config, np.zeros((8, config.taxels), np.int16))  # loads the compiled loop
    seconds, events = 0.0, 0
    for name in names:
        samples = _second(config, large_enough(images[name].load(), config))
        seconds += statistics.median(timed(encode, config, samples, counts)[1] for _ in range(3))
        events += int(np.abs(counts.astype(np.int64)).sum())
    return seconds, events


def functional(tiles: int, side: int) -> dict[str, Any]:
    """Return the time of the functional model for a second of texture on two cores."""
    config = ReadoutConfig(rows=side, columns=side)
    textures = [texture.name for texture in embedded_dataset()]
    names = [textures[tile % len(textures)] for tile in range(tiles)]
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        found = pool.map(_encode, [(config, names[core::2]) for core in range(2)], chunksize=1)
    taxels, seconds = tiles * config.taxels, sum(seconds for seconds, _ in found)
    return {
        "taxels": taxels,
        "tiles": tiles,
        "side": side,
        "samples": taxels * int(config.sample_rate_hz),
        "events": sum(events for _, events in found),
        "slower_core_s": round(max(seconds for seconds, _ in found), 3),
        "ns_per_taxel_sample": round(1e9 * seconds / (taxels * config.sample_rate_hz), 3),
    }


def main(
    part: Annotated[Literal["arrays", "skins", "tiles", "encoders"], typer.Argument(help="part to measure")],
    sides: Annotated[str, typer.Option(help="sides of the arrays, separated by commas")] = "8,16,32,64",
    out: JsonFile = None,
) -> None:
    """Measure square arrays, a skin of 65,536 taxels, skins of tiles, or the functional model.

    The result file is benchmarks/results/scale_PART.json by default, and is written after each measurement.
    """
    measure, sizes = {
        "arrays": (array, [(int(side),) for side in sides.split(",")]),
        "skins": (skin, ((6, 64), (6, 5000), (2, 5000))),
        "tiles": (tiles_of, [(side, n, n) for side in (8, 32) for n in (1, 2, 4, 8)]),
        "encoders": (functional, ((1, 8), (4, 8), (1, 32), (4, 32), (16, 32), (64, 32))),
    }[part]
    command = f"arrays --sides {sides}" if part == "arrays" else part
    found: list[dict[str, Any]] = []
    for size in sizes:
        print(part, *size, flush=True)
        found.append(measure(*size))
        print(json.dumps(found[-1]), flush=True)
        content = {"benchmark": f"scale of {part}", "cpus": os.cpu_count(), "results": found}
        write(out or RESULTS / f"scale_{part}.json", "scale", command, content)


if __name__ == "__main__":
    typer.run(main)
