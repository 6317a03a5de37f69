"""Compare a readout with registers with the golden model in every clock, under random host access."""

import json
import os
import random
from collections import Counter
from fractions import Fraction
from pathlib import Path
from typing import Any

import cocotb
import numpy as np

from eskin.cocotb_tests.bench.analog import ideal
from eskin.cocotb_tests.bench.block import JOB, Block, Simulator, begin, report
from eskin.cocotb_tests.bench.block import bits as flags
from eskin.cocotb_tests.bench.host import happens, pins_of, walk
from eskin.cocotb_tests.runner.simulator import build
from eskin.model.classifier.words import packed, unpacked
from eskin.model.config import ReadoutConfig
from eskin.model.encoders.fields import SETTABLE

CLOCKS = 6000


# -- in the simulator --------------------------------------------------------------------------------


class Comparators:
    """Ideal comparators of the array; while ``compare`` is low they answer wrongly."""

    def __init__(self, config: ReadoutConfig, block: Block) -> None:
        self.config, self.block = config, block

    def look(self, samples: list[int]) -> None:
        """Drive the comparator outputs."""
        config, bits = self.config, self.config.sample_bits
        if config.receptive_fields == SETTABLE:
            samples = self._selected(samples)
        codes = unpacked(self.block.read("reference_code"), config.taxels, bits)
        widths = [self.block.read("step_code")] * config.taxels
        if config.closes:
            width, size = self.block.read("half_width"), config.half_width_bits
            widths = [width >> taxel * size & (1 << size) - 1 for taxel in range(config.taxels)]
        found = [ideal(config, *three) for three in zip(samples, codes, widths, strict=True)]
        wrong = ~self.block.read("compare")
        self.block.drive(
            above=flags([above for above, _ in found]) ^ wrong, below=flags([below for _, below in found]) ^ wrong
        )

    def _selected(self, samples: list[int]) -> list[int]:
        """Return the outputs of the input multiplexers, 0 without a selected line."""
        lines = self.block.read("field_select")
        found = []
        for taxel, sample in enumerate(samples):
            row, column = divmod(taxel, self.config.columns)
            around = [(row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)]
            inside = [y in range(self.config.rows) and x in range(self.config.columns) for y, x in around]
            near = [
                samples[y * self.config.columns + x] if there else sample
                for (y, x), there in zip(around, inside, strict=True)
            ]
            mean = round(Fraction(sum(near), 4)), round(Fraction(sum(near) + 4 * sample, 8))
            found.append({0: 0, 1: sample, 2: mean[0], 4: mean[1]}[lines >> 3 * taxel & 7])
        return found


@cocotb.test()
async def readout_follows_its_model(dut: Any) -> None:
    """Play a prepared run, and compare events, MISO and its pad enable with the model in every clock."""
    config, _, block, check = begin(dut)
    with np.load(os.environ["ESKIN_HOST"]) as stored:
        played = {name: stored[name].tolist() for name in stored.files}
    samples = dict(zip(played["sample_clock"], played["samples"], strict=True))
    expected = {event[0]: event[1:] for event in played["events"]}
    analog = Comparators(config, block) if config.frontend == "analog" else None
    decisions = played.get("decisions")
    held = [0] * config.taxels
    block.drive(spi_sck=0, spi_cs_n=1, spi_mosi=0, sample_valid=0, sample=0, event_ready=0, above=0, below=0)
    block.drive(taxel_enable=0, aer_ack=0)
    await block.reset()
    for clock, (sck, cs_n, mosi) in enumerate(played["pins"]):
        ready = played["ready"][clock % len(played["ready"])]
        block.drive(spi_sck=sck, spi_cs_n=cs_n, spi_mosi=mosi, event_ready=ready)
        block.drive(taxel_enable=int(played["enable"][clock], 2), sample_valid=clock in samples)
        if clock in samples and analog is None:
            block.drive(sample=packed(samples[clock], config.sample_bits))
        if decisions:
            block.drive(above=int(decisions[0][clock], 2), below=int(decisions[1][clock], 2))
        elif analog is not None:
            analog.look(held)
        await block.settle()
        if analog is not None:
            check.equal("compare", int(played["compare"][clock], 2), block.read("compare"))
        check.equal("spi_miso", played["miso"][clock], block.read("spi_miso"))
        check.equal("spi_miso_enable", played["miso_enable"][clock], block.read("spi_miso_enable"))
        found = None
        if block.read("event_valid") and ready:
            polarity = block.read("event_polarity") if config.has_polarity else 1
            found = [block.read("event_col"), block.read("event_row"), polarity]
            check.counts["events"] += 1
        check.holds("EventsOfTheModel", found == expected.get(clock), (clock, found, expected.get(clock)))
        check.counts["ones read"] += played["miso"][clock]
        held = samples.get(clock, held)
        await block.edge()
    report(check.counts)


# -- outside -----------------------------------------------------------------------------------------


def whatever(config: ReadoutConfig, clocks: int, draw: np.random.Generator) -> np.ndarray:
    """Return arbitrary comparator decisions: none, above, below, both or random."""
    shape = (clocks, config.taxels)
    while_ = np.repeat(draw.integers(0, 5, (clocks // 40 + 1, config.taxels)), 40, axis=0)[:clocks]
    found = np.where(while_ == 4, draw.integers(0, 4, shape), while_).astype(np.uint8)
    return found if config.has_polarity else found & 1


def rows(bits: np.ndarray) -> list[str]:
    """Return rows of bits as texts, most significant bit first."""
    return ["".join("1" if on else "0" for on in row[::-1]) for row in bits]


def inputs_of(stimulus: Any) -> dict[str, Any]:
    """Return samples, mask and comparator decisions of a stimulus, as a bench plays them in every clock."""
    at = np.searchsorted(stimulus.enable_clock, np.arange(stimulus.clocks), side="right") - 1
    found = {
        "samples": stimulus.samples,
        "sample_clock": stimulus.sample_clock,
        "enable": rows(stimulus.enable[at]),
    }
    if stimulus.decisions is not None:
        found["decisions"] = [rows(stimulus.decisions & side) for side in (1, 2)]
    return found


def prepare(
    config: ReadoutConfig, folder: Path, seed: int, given: list[Any] | None = None, anything: bool = False
) -> tuple[Path, Counter[str]]:
    """Write a run with the expected results; return the file, and the counts of its activities.

    The host's pins are given, with frequent mask changes, or come from ``pins_of``. An analog signal exceeds both ends
    of the scale, or the comparators follow ``anything`` instead of the signal.
    """
    from eskin.model.host import play
    from eskin.model.readout import Stimulus, strobes

    rng, draw = random.Random(seed), np.random.default_rng(seed)
    clocks = CLOCKS if given is None else len(given)
    period = 24
    ticks = clocks // period
    samples = walk(config, ticks, draw)
    changes = sorted(rng.sample(range(1, clocks), 6 if given is None else 60))
    stimulus = Stimulus(
        samples=samples,
        sample_clock=np.arange(ticks, dtype=np.int64) * period + 3,
        clocks=clocks,
        enable_clock=np.array([0, *changes], np.int64),
        enable=draw.random((len(changes) + 1, config.taxels)) < 0.9,
        ready=(draw.random(4096) < 0.6).astype(np.uint8),
        decisions=whatever(config, clocks, draw) if anything else None,
    )
    pins = pins_of(config, clocks, rng) if given is None else given
    played = play(config, stimulus, pins)
    path = folder / "host.npz"
    inputs = inputs_of(stimulus)
    if config.frontend == "analog":
        inputs["compare"] = rows(strobes(config, played.stimulus))
    events = np.array([[int(e["t"]), int(e["x"]), int(e["y"]), int(e["p"])] for e in played.events]).reshape(-1, 4)
    np.savez(
        path,
        ready=stimulus.ready,
        pins=np.array(pins),
        events=events,
        miso=played.miso,
        miso_enable=played.miso_enable,
        **inputs,
    )
    return path, happens(played) + Counter(events=len(played.events))


def play(
    config: ReadoutConfig,
    simulator: Simulator,
    folder: Path,
    seed: int,
    given: list[Any] | None = None,
    anything: bool = False,
) -> tuple[Counter[str], Counter[str]]:
    """Prepare and play a run; return its counts, and the counts of its activities."""
    path, counts = prepare(config, folder, seed, given, anything)
    env = {JOB: json.dumps({"config": config.to_dict(), "seed": seed}), "ESKIN_HOST": str(path)}
    build(config, simulator, top="eskin_readout").test(__name__, folder, "readout_follows_its_model", env)
    return Counter(json.loads((folder / "counts.json").read_text())), counts
