"""The chip: samples in, classes out, held to both models with the events that pass between the two."""

from __future__ import annotations

import json
import os
import random
from collections import Counter
from pathlib import Path
from typing import Any

import cocotb
import numpy as np
import pytest

from cocotb_tests.bench.block import JOB, Block, Checker, report
from cocotb_tests.bench.classifier import load_words
from cocotb_tests.bench.textures import random_scan
from cocotb_tests.test_classifier import random_network
from cocotb_tests.test_verilog import lint
from model.classifier.chip_config import ChipConfig
from model.classifier.config import ClassifierConfig
from model.classifier.run import simulate
from model.config import ReadoutConfig
from model.errors import InputError
from model.events.address import taxel_of
from model.readout import Stimulus
from model.readout import simulate as simulate_readout
from rtl.delivery import write

OUTPUTS = ("event_valid", "event_ready", "event_channel", "class_valid", "class_index", "overrun")


@cocotb.test()
async def samples_become_the_classes_of_both_models(dut: Any) -> None:
    """A moving texture; every event that the classifier held back and every class is that of the models."""
    fields = json.loads(os.environ[JOB])
    config, rng = ChipConfig.from_dict(fields["config"]), random.Random(fields["seed"])
    readout, samples = config.readout, np.load("samples.npy")
    block = Block(dut)
    check = Checker(block)
    network = random_network(config.classifier, rng)
    block.drive(rst=1, taxel_enable=(1 << readout.taxels) - 1, sample_valid=0, sample=0, scan_start=0, load_valid=0)
    await load_words(block, network, rng)
    await block.reset(2)
    seen: dict[str, list[int]] = {name: [] for name in OUTPUTS}
    mask = (1 << readout.sample_bits) - 1
    for clock in range(len(samples) * readout.clocks_per_sample):
        tick, phase = divmod(clock, readout.clocks_per_sample)
        codes = [(int(code) & mask) << n * readout.sample_bits for n, code in enumerate(samples[tick])]
        block.drive(sample_valid=phase == 0, sample=sum(codes))
        await block.settle()
        for name in OUTPUTS:
            seen[name].append(block.read(name))
        await block.edge()
    _compare(config, network, samples, seen, check)
    report(check.counts)


def _compare(config: ChipConfig, network: Any, samples: Any, seen: dict[str, list[int]], check: Checker) -> None:
    """Hold the events to the readout's model under that ``event_ready``, and the rest to the classifier's."""
    readout, classifier = config.readout, config.classifier
    valid, ready = np.array(seen["event_valid"]), np.array(seen["event_ready"], np.uint8)
    events = simulate_readout(readout, Stimulus.from_samples(readout, samples, ready=ready))
    channels = taxel_of(events, readout) + np.where(events["p"] | (not config.polarity), 0, readout.taxels)
    taken = np.flatnonzero(valid & ready)
    check.holds("EventsOfTheReadout", np.array_equal(taken, events["t"]), (taken, events["t"]))
    got = np.array(seen["event_channel"])[taken]
    check.holds("ChannelsOfTheEvents", np.array_equal(got, channels), (got, channels))
    offered, behind = [], 0
    for clock, channel in zip(taken.tolist(), channels.tolist(), strict=True):
        offered.append((behind + int(valid[behind:].argmax()), channel))
        behind = clock + 1
    ends = list(range(classifier.clocks_per_bin - 1, len(valid), classifier.clocks_per_bin))
    run = simulate(network, offered, ends, len(valid))
    check.holds("EventsTakenInTheirClocks", run.accepted == taken.tolist(), run.accepted)
    classes = [(clock, seen["class_index"][clock]) for clock in np.flatnonzero(seen["class_valid"]).tolist()]
    done = [(c, b.winner) for c, b in zip(run.valid, run.bins, strict=True) if c < len(valid)]
    check.holds("ClassesOfTheModel", classes == done, (classes, done))
    check.holds("OverrunOfTheModel", any(seen["overrun"]) == bool(run.overruns), run.overruns)
    check.counts["events"], check.counts["bins"] = len(taken), len(done)
    check.counts["stalled"] = run.stalled
    check.counts["spikes"] = sum(int(b.spikes.sum()) for b in run.bins)
    check.counts["classes"] = len({winner for _, winner in done})


def chip(rows: int, columns: int, channels: int, hidden: int, **own: Any) -> ChipConfig:
    """Return a chip whose clock is as slow as the network allows, so that bursts must wait."""
    readout = ReadoutConfig(rows=rows, columns=columns, resolution=6, clocks_per_sample=64, **own)
    fields: dict[str, Any] = {
        "threshold": 200,
        "out_threshold": 200,
        "floor": -200,
        "out_floor": -200,
        "lanes": 4,
        "bin_s": 0.0003,
    }
    network = ClassifierConfig(inputs=channels, hidden=hidden, classes=3, reset=readout.reset, **fields)
    return ChipConfig(readout=readout, classifier=network)


CHIPS = [chip(3, 5, 30, 20), chip(2, 4, 8, 24, encoding="nlcs", reset="async")]


@pytest.mark.parametrize("config", CHIPS, ids=lambda c: f"{c.readout.rows}x{c.readout.columns}-{c.readout.encoding}")
def test_chip_takes_samples_and_gives_the_classes_of_the_models(config: ChipConfig, tmp_path: Path) -> None:
    from cocotb_tests.session.simulator import build  # not in the simulator, which imports this file too

    samples = random_scan(config.readout, 50, np.random.default_rng(config.readout.taxels))
    np.save(tmp_path / "samples.npy", samples)
    program = build(config, "icarus", top="eskin_chip")
    environment = {JOB: json.dumps({"config": config.to_dict(), "seed": 3})}
    program.test("cocotb_tests.test_chip", tmp_path, "samples_become_the_classes_of_both_models", environment)
    counts = Counter(json.loads((tmp_path / "counts.json").read_text()))
    assert counts["events"] > 100
    assert counts["stalled"] > 100
    assert counts["bins"] >= 5
    assert counts["spikes"] > 5
    assert ChipConfig.from_dict(config.to_dict()) == config


def test_the_files_of_a_chip_are_clean_and_agree(tmp_path: Path) -> None:
    paths = write(CHIPS[0], tmp_path)
    assert [path.name for path in paths] == [f"eskin_chip.{suffix}" for suffix in ("v", "sdc", "json", "core")]
    assert lint(paths[0]) == ""
    described = json.loads(paths[2].read_text())
    assert ChipConfig.from_dict(described["configuration"]) == CHIPS[0]
    assert described["clock_hz"] == CHIPS[0].readout.clock_hz
    names = {port["name"] for port in described["ports"]}
    assert {"sample", "taxel_enable", "event_channel", "class_index", "load_data"} <= names
    assert not {"bin_end", "event_row"} & names


def test_what_does_not_fit_is_refused_in_one_sentence() -> None:
    with pytest.raises(InputError, match="takes 29 channels, 3 x 5 taxels of lcs have 15 or 30; give the readout"):
        chip(3, 5, 29, 20)
    with pytest.raises(InputError, match="has 384 clocks, its work takes 1505; raise --clocks-per-sample"):
        chip(3, 5, 30, 500)
    with pytest.raises(InputError, match="link stream within, not four_phase"):
        chip(3, 5, 30, 20, link="four_phase")
