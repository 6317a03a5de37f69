"""The analog taxel in transistors: comparator, DAC, and loops of taxels and Verilog (docs/results/analog.md).

``--comparator mine.sp`` measures another comparator: a netlist with a subcircuit
``comparator clk inp inn outp outn vdd vss`` of transistors of the kit. It decides with the rising edge of clk.
"""

import argparse
import dataclasses
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from eskin.analog import characterise as measure
from eskin.analog.circuit import FrontEnd, Taxel
from eskin.analog.loop import different, play
from eskin.base.errors import InputError
from eskin.base.figures.style import PALETTE, dress, new_figure, save_figure
from eskin.base.files import digest
from eskin.base.workers.engine import Needs
from eskin.model.config import ReadoutConfig
from studies.study import OUT, Data, Result, work_of

CONFIG = ReadoutConfig(rows=1, columns=1, sample_bits=8, resolution=6, frontend="analog")
"""A taxel of LCS 6 b; the DAC has no bits below D, except for CW-LCS."""

LOOPS = {
    "lcs": CONFIG,
    "cw-lcs": CONFIG.replace(encoding="cw-lcs", sample_bits=10, window_period=8),
    "nlcs": CONFIG.replace(encoding="nlcs", leak_period=20, leak_shift=3),
    "nlcs-bipolar": CONFIG.replace(encoding="nlcs-bipolar", leak_period=20, leak_shift=3),
    "lcs 2 x 2": CONFIG.replace(rows=2, columns=2),
}
"""Loops by name; every taxel of the last has comparators with offsets of its own."""

TICKS, SHORT_TICKS = 200, 60
"""Sample ticks of a loop, and of that of four taxels."""

REFERENCES = [-112, -64, -32, -8, -1, 0, 8, 32, 64, 112]
SEED = 1
NEEDS = Needs(("base", "model", "rtl", "cocotb_tests", "analog"), ("numpy", "scipy"))


def comparator(front_end: FrontEnd, samples: int = 20) -> Data:
    """Return energy, offset, noise, delay, kick-back and linearity, and energy and delay at the corners."""
    taxel, one_side = Taxel(front_end, CONFIG), Taxel(front_end, CONFIG.replace(encoding="nlcs"))
    store, key = work_of("analog", NEEDS), digest(front_end.to_dict())
    period_s = 1 / CONFIG.clock_hz
    parts: dict[str, Callable[[], Data]] = {
        "corners": lambda: {"rows": measure.corners(front_end, CONFIG)},
        "delay": lambda: measure.delays(front_end),
        "kick_back": lambda: measure.kick_back(front_end, 1e-3, front_end.unit_f * taxel.units),
        "dac": lambda: measure.dac(taxel, period_s, REFERENCES),
        "one_side": lambda: measure.dac(one_side, period_s, [16, 48, 64, 80, 112]),
        "offset": lambda: measure.offset(front_end, samples),
        "noise": lambda: measure.noise(front_end),
    }
    with ThreadPoolExecutor(2) as pool:
        found = pool.map(lambda name: store.of(f"{name} {key}", parts[name]), parts)
    origin = {"front_end": front_end.to_dict(), "config": CONFIG.to_dict()}
    return origin | dict(zip(parts, found, strict=True))


def loops(front_end: FrontEnd) -> Data:
    """Return the events of every loop, against the model and against a behavioural comparator."""
    measured = comparator(front_end)
    gain, offset_v, sigma_v = measured["dac"]["gain"], measured["offset"]["systematic_v"], measured["offset"]["sigma_v"]
    store, key, rows = work_of("analog_loops", NEEDS), digest(front_end.to_dict()), []
    for name, config in LOOPS.items():
        spread_v = sigma_v if config.taxels > 1 else 0.0
        row = store.of(f"{name} {key}", partial(loop, name, config, front_end, gain, offset_v, spread_v))
        rows.append({"name": name} | row)
    return {"front_end": front_end.to_dict(), "rows": rows}


def loop(name: str, config: ReadoutConfig, front_end: FrontEnd, gain: float, offset_v: float, spread_v: float) -> Data:
    """Return the events of one loop; comparators have random offsets of deviation ``spread_v``."""
    offsets_v = np.random.default_rng(SEED).normal(0, 1, (config.taxels, 2)) * spread_v
    folder = OUT / "analog" / name.replace(" ", "-")
    signal = touch(config, TICKS if config.taxels == 1 else SHORT_TICKS)
    found = play(config, front_end, signal, folder / "transistors", gain=gain, offsets_v=offsets_v)
    behaved = play(config, front_end, signal, folder / "behaviour", gain=gain, offsets_v=offsets_v, behave=offset_v)
    ideal = play(config, front_end, signal, folder / "ideal", behave=0.0)
    return {
        "config": config.to_dict(),
        "ticks": len(signal),
        "events": len(found.events),
        "different": found.different,
        "decisions": int(found.strobes.sum()),
        "missed_by_behaviour": different(found.events, behaved.events) / 2,
        "missed_by_ideal": different(found.events, ideal.events) / 2,
        "offsets_v": offsets_v.tolist(),
    }


def touch(config: ReadoutConfig, ticks: int) -> NDArray[np.float64]:
    """Return a touch in codes: a slide over 0.3 of the ticks, a rest of 0.4, and a slide back."""
    place = np.interp(np.arange(ticks), [0, 0.3 * ticks, 0.7 * ticks, ticks], [0.0, 1.0, 1.0, 0.0])
    phase = 0.2 + 2 * np.pi * 0.75 * place[:, None] + np.arange(config.taxels)
    middle = 0.0 if config.has_polarity else 0.5
    return config.full_scale * (middle + 0.12 * np.sin(phase))


def draw(data: Data, path: Path) -> None:
    """Draw delay over input, offsets, and energy over the reference."""
    figure = new_figure(8.4, 2.9, "A comparator and a DAC in SKY130 transistors")
    panels = figure.subplots(1, 3)
    delay, offset, dac = data["delay"], data["offset"], data["dac"]
    delays_ns = np.array(delay["delays_s"], float) * 1e9
    panels[0].semilogx(np.array(delay["inputs_v"]) * 1e3, delays_ns, "o-", color=PALETTE["blue"])
    panels[1].hist(np.array(offset["samples_v"]) * 1e3, bins=8, color=PALETTE["orange"])
    panels[2].plot(dac["references"], np.array(dac["energies_j"]) * 1e12, "o-", color=PALETTE["black"])
    panels[2].set_ylim(bottom=0)
    words = (
        ("Delay", "input, mV", "ns"),
        ("Offset", "offset, mV", "comparators"),
        ("Energy", "reference", "pJ a decision"),
    )
    for panel, text in zip(panels, words, strict=True):
        dress(panel, *text)
    save_figure(figure, path)


def main() -> None:
    """Run the study with the options of the command line."""
    parser = argparse.ArgumentParser("python -m studies.analog", description=__doc__)
    parser.add_argument("--out", type=Path, default=OUT, metavar="DIR", help=f"folder for data and figures [{OUT}]")
    parser.add_argument("--comparator", type=Path, metavar="FILE", help="netlist of another comparator")
    parser.add_argument("--loops", action="store_true", help="play a touch with the Verilog of each encoder; minutes")
    options = parser.parse_args()
    try:
        front_end = FrontEnd()
        if options.comparator is not None:
            if not options.comparator.is_file():
                raise InputError(f"{options.comparator} does not exist; give a netlist with a subcircuit comparator")
            front_end = dataclasses.replace(front_end, comparator=options.comparator.read_text())
        known = options.comparator is None  # else the data of another comparator may be there
        results = [Result("analog/comparator", partial(comparator, front_end), draw, long=known)]
        if options.loops:
            results.append(Result("analog/loops", partial(loops, front_end), long=known))
        for result in results:
            for path in result.make("analog", options.out):
                print(f"wrote {path}")
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    main()
