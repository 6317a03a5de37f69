"""The analog taxel in transistors: comparator, DAC, and loops of taxels and Verilog (docs/results/analog.md).

``--comparator mine.sp`` measures another comparator: a netlist with a subcircuit
``comparator clk inp inn outp outn vdd vss`` of transistors of the kit. It decides with the rising edge of clk.
"""

import argparse
import dataclasses
import re
import sys
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from eskin.analog import characterise as measure
from eskin.analog.circuit import FrontEnd, Taxel
from eskin.analog.loop import play
from eskin.base.errors import InputError
from eskin.base.figures.style import PALETTE, dress, new_figure, save_figure
from eskin.base.files import digest, read_json
from eskin.base.workers.engine import Needs, version
from eskin.model.address_events import Events
from eskin.model.config import ReadoutConfig
from eskin.skin.samples import content_of
from eskin.skin.textures.dataset import open_dataset
from eskin.skin.textures.presets import preset
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

TICKS = 200
"""Sample ticks of a loop."""

REFERENCES = [-112, -64, -32, -8, -1, 0, 8, 32, 64, 112]
ONE_SIDE = 6, 9
"""Resolutions of a taxel with one side, N-LCS or a SAR."""

SEED = 1
NEEDS = Needs(("base", "model", "rtl", "skin", "cocotb_tests", "analog"), ("numpy", "scipy"))


def comparator(front_end: FrontEnd) -> Data:
    """Return energy, offset, noise, delay, kick-back and linearity, and energy and delay at the corners."""
    taxel = Taxel(front_end, CONFIG)
    store, key = work_of("analog", NEEDS), digest(front_end.to_dict())
    period_s = 1 / CONFIG.clock_hz
    parts: dict[str, Callable[[], Data]] = {
        "corners": lambda: {"rows": measure.corners(front_end, CONFIG)},
        "delay": lambda: measure.delays(front_end),
        "kick_back": lambda: measure.kick_back(front_end, 1e-3, front_end.unit_f * taxel.units),
        "dac": lambda: measure.dac(taxel, period_s, REFERENCES),
        **{f"one_side_{bits}b": partial(one_side, front_end, bits) for bits in ONE_SIDE},
        "own": lambda: {"offsets_v": measure.own_offsets(taxel)},
        "offset": lambda: measure.offset(front_end),
        "noise": lambda: measure.noise(front_end),
    }
    with ThreadPoolExecutor(2) as pool:
        found = pool.map(lambda name: store.of(f"{name} {key}", parts[name]), parts)
    origin = {"front_end": front_end.to_dict(), "config": CONFIG.to_dict()}
    return origin | dict(zip(parts, found, strict=True))


def one_side(front_end: FrontEnd, bits: int) -> Data:
    """Return linearity and energies of a taxel with one side, at references from an eighth of the scale on."""
    config = CONFIG.replace(encoding="nlcs", sample_bits=bits + 2, resolution=bits)
    references = [config.full_scale * eighths // 8 for eighths in (1, 3, 4, 5, 7)]
    return measure.dac(Taxel(front_end, config), 1 / config.clock_hz, references)


def loops(front_end: FrontEnd) -> Data:
    """Return the events of a touch in every loop, against the model and against behavioural comparators."""
    return {"rows": [loop(name, config, front_end, touch(config)) for name, config in LOOPS.items()]}


def scan(front_end: FrontEnd) -> Data:
    """Return the events of a taxel that slides over the first texture for 0.4 s."""
    texture = open_dataset()[0]
    signal = CONFIG.full_scale * preset("paper").signals(CONFIG, texture.load())
    return {"texture": texture.name, "rows": [loop("lcs scan", CONFIG, front_end, signal)]}


def loop(name: str, config: ReadoutConfig, front_end: FrontEnd, signal: NDArray[np.float64]) -> Data:
    """Return the events of one loop; if there are several taxels, their comparators have random offsets."""
    measured, store = comparator(front_end), work_of("analog_loops", NEEDS)
    gain, noise_v = measured["dac"]["gain"], measured["noise"]["sigma_v"]
    sigma_v = measured["offset"]["sigma_v"] if config.taxels > 1 else 0.0
    mismatch_v = np.random.default_rng(SEED).normal(0, 1, (config.taxels, 2)) * sigma_v
    key = f"{name} {digest(front_end.to_dict())}"
    own_v = store.of(f"{key} offsets", partial(measure.own_offsets, Taxel(front_end, config)))
    offsets_v = mismatch_v + [*own_v, 0.0][:2]  # a taxel with one side uses the first only
    folder = OUT / "analog" / name.replace(" ", "-")

    def played() -> Data:
        found = play(
            config, front_end, signal, folder / "transistors", gain=gain, offsets_v=mismatch_v, code=version(NEEDS)
        )
        behaved = {
            "measured": play(config, front_end, signal, folder, gain=gain, offsets_v=offsets_v, noise_v=0.0),
            "noisy": play(config, front_end, signal, folder, gain=gain, offsets_v=offsets_v, noise_v=noise_v),
            "ideal": play(config, front_end, signal, folder, noise_v=0.0),
        }
        return {
            "config": config.to_dict(),
            "ticks": len(signal),
            "events": len(found.events),
            "different": found.different,
            "decisions": int(found.strobes.sum()),
            "missed": {kind: missed(found.events, one.events, config) for kind, one in behaved.items()},
            "mismatch_v": mismatch_v.tolist(),
            "own_offsets_v": own_v,
        }

    return {"name": name} | store.of(f"{key} {digest(signal.tolist())}", played)


def missed(one: Events, other: Events, config: ReadoutConfig) -> float:
    """Return half the number of events that only one of two loops has in their tick."""
    a, b = (Counter((t // config.clocks_per_sample, *rest) for t, *rest in events.tolist()) for events in (one, other))
    return ((a - b) + (b - a)).total() / 2


def touch(config: ReadoutConfig) -> NDArray[np.float64]:
    """Return a touch in codes: a slide over 0.3 of the ticks, a rest of 0.4, and a slide back."""
    place = np.interp(np.arange(TICKS), [0, 0.3 * TICKS, 0.7 * TICKS, TICKS], [0.0, 1.0, 1.0, 0.0])
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


def summary(data: Data) -> list[str]:
    """Return the most important results as lines of text."""
    if "rows" in data:
        words = "{name}: {events} events, {different} differences from the model; {missed[measured]:g} events are in "
        words += "another tick with the behavioural comparator, {missed[ideal]:g} with an ideal one"
        return [words.format(**row) for row in data["rows"]]
    typical, offset = data["corners"]["rows"][0], data["offset"]
    return [
        f"decision: {1e12 * typical['same_j']:.3f} pJ, {1e9 * typical['delay_s']:.2f} ns at 1 mV",
        f"offset: {1e3 * offset['systematic_v']:.2f} mV; by mismatch, deviation {1e3 * offset['sigma_v']:.2f} mV",
        f"noise: {1e3 * data['noise']['sigma_v']:.2f} mV",
        f"kick-back: {1e3 * data['kick_back']['peak_v']:.0f} mV; DAC: gain {data['dac']['gain']:.3f}",
    ]


def netlist_of(path: Path) -> str:
    """Return a netlist as text without continuation lines, and never empty: the default is this project's."""
    text = content_of(path, "the netlist").decode(errors="replace")
    return re.sub(r"\r?\n[ \t]*\+", " ", text) or "\n"


def main() -> None:
    """Run the study with the options of the command line."""
    parser = argparse.ArgumentParser("python -m studies.analog", description=__doc__)
    parser.add_argument("--out", type=Path, default=OUT, metavar="DIR", help=f"folder for data and figures [{OUT}]")
    parser.add_argument("--comparator", type=Path, metavar="FILE", help="netlist of another comparator")
    parser.add_argument("--loops", action="store_true", help="play a touch with the Verilog of each encoder; minutes")
    parser.add_argument(
        "--scan", action="store_true", help="play a texture of 0.4 s with the Verilog of LCS; 10 minutes"
    )
    options = parser.parse_args()
    try:
        front_end = FrontEnd()
        if options.comparator is not None:
            front_end = dataclasses.replace(front_end, comparator=netlist_of(options.comparator))
            measure.check(front_end)
        known = options.comparator is None  # else the data of another comparator may be there
        results = {"analog": Result("analog/comparator", partial(comparator, front_end), draw, long=known)}
        if options.loops:
            results["analog --loops"] = Result("analog/loops", partial(loops, front_end), long=known)
        if options.scan:
            results["analog --scan"] = Result("analog/scan", partial(scan, front_end), long=known)
        for command, result in results.items():
            for path in result.make(command, options.out):
                if path.suffix == ".json":
                    print("\n".join(summary(read_json(path, "the data of the study", dict))))
                print(f"wrote {path}")
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    main()
