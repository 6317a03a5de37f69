"""Compare both models: events, clocks, order, polarity, final registers, frames and classes.

The second model imports nothing of the project.

Configurations and stimuli are drawn anew in every run (conftest.py prints the seed).
"""

import ast
import dataclasses
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eskin.cocotb_tests import independent
from eskin.cocotb_tests.bench.random_run import RandomRun, runs
from eskin.model.classifier.config import LEAKS, ClassifierConfig, highest, lowest
from eskin.model.classifier.network import IntegerNetwork, State
from eskin.model.events.compare import first_difference
from eskin.model.frame import FrameStimulus
from eskin.model.frame import simulate as simulate_frames
from eskin.model.frame_config import FrameConfig
from eskin.model.readout import simulate
from eskin.model.tiles.config import TilesConfig
from eskin.model.tiles.run import simulate_skin
from tests.independent.agreement import differs, network_of, play, play_frames, play_skin
from tests.model.test_frame import configs as frame_configs

FILES = sorted(Path(str(independent.__file__)).parent.glob("*.py"))
RUNS = 20
RANDOM = runs(600, most_taxels=24, noisy=True)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_the_second_imports_nothing_of_the_rest_of_the_project(path: Path) -> None:
    for node in ast.walk(ast.parse(path.read_text())):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        names += [str(node.module)] if isinstance(node, ast.ImportFrom) else []
        foreign = [name for name in names if not name.startswith("eskin.cocotb_tests.independent.")]
        assert {name.split(".")[0] for name in foreign} <= sys.stdlib_module_names


def test_both_give_the_same_events_and_registers() -> None:
    events: Counter[bool] = Counter()  # of ideal and of noisy comparators

    @settings(max_examples=300)
    @given(RANDOM)
    def agree(run: RandomRun) -> None:
        assert not (found := differs(run.config, run.stimulus)), found
        events[run.noisy] += len(simulate(run.config, run.stimulus))

    agree()
    assert min(events[False], events[True]) > 0


@settings(max_examples=RUNS)
@given(RANDOM, st.data())
def test_a_reset_in_any_clock_leaves_nothing_behind(run: RandomRun, data: st.DataObject) -> None:
    first = run.stimulus
    cut = dataclasses.replace(first, clocks=data.draw(st.integers(1, run.clocks)))
    if first.decisions is not None:
        cut = dataclasses.replace(cut, decisions=first.decisions[: cut.clocks])
    _, readout = play(run.config, cut)
    readout.clock(sample_valid=True, sample=[1] * run.config.taxels, rst=True)
    assert not (found := differs(run.config, first, readout)), found


@settings(max_examples=RUNS)
@given(RANDOM)
def test_a_shorter_run_is_the_beginning_of_a_longer_one(run: RandomRun) -> None:
    events = [simulate(run.config, dataclasses.replace(run, clocks=clocks).stimulus) for clocks in (200, 600)]
    before = events[1][events[1]["t"] < 199]
    assert before.tolist() == events[0][events[0]["t"] < 199].tolist()


TILE = runs(300, most_taxels=6, frontend=["digital"], link=["stream"], registers=["none"], receptive_fields=["own"])


@settings(max_examples=9)
@given(TILE, st.integers(1, 3), st.integers(1, 3))
def test_skins_of_tiles_give_the_same_events(run: RandomRun, down: int, across: int) -> None:
    skin = TilesConfig.of(run.config, down, across)
    of_tiles = [dataclasses.replace(run, seed=run.seed + tile).stimulus.samples for tile in range(skin.tiles)]
    ticks = min(map(len, of_tiles))
    first = dataclasses.replace(run.stimulus, sample_clock=run.stimulus.sample_clock[:ticks])
    stimuli = [dataclasses.replace(first, samples=samples[:ticks]) for samples in of_tiles]
    found = first_difference(simulate_skin(skin, stimuli), play_skin(skin, stimuli))
    assert found is None, found


def frame_stimulus(config: FrameConfig, rng: np.random.Generator) -> FrameStimulus:
    clocks, scale = 400, config.readout.full_scale
    at = np.unique(np.concatenate([[0], rng.integers(0, clocks, 30)]))
    return FrameStimulus(
        samples=rng.integers(-scale, scale, (len(at), config.taxels)),
        sample_clock=at,
        frame_clock=np.unique([rng.integers(0, 50), *rng.integers(0, clocks, int(rng.integers(0, 40)))]),
        clocks=clocks,
        conversion=rng.integers(1, 6, 16),
        ready=(rng.random(64) < rng.choice([0.2, 0.7, 1.0])).astype(np.uint8),
    )


@settings(max_examples=2 * RUNS)
@given(frame_configs(), st.integers(0, 2**32))
def test_frames_have_the_same_words_starts_and_overruns(config: FrameConfig, seed: int) -> None:
    stimulus = frame_stimulus(config, np.random.default_rng(seed))
    words, starts, missed = play_frames(config, stimulus)
    run = simulate_frames(config, stimulus)
    assert words == run.words.tolist()
    assert starts == [tuple(start) for start in run.starts.tolist()]
    assert missed == run.overruns.tolist()
    assert starts


def network_draw(rng: np.random.Generator) -> IntegerNetwork:
    def one(*values: Any) -> Any:
        value = rng.choice(np.array(values, object))
        return value

    def leak() -> tuple[int, int]:
        shift = one(0, 1, 4)
        return shift, one(1, *range(2, 2**shift + 1))

    leaks = {f"{name}_{part}": value for name in LEAKS for part, value in zip(("shift", "factor"), leak(), strict=True)}
    if own := one(False, True):
        leaks |= {"leak_factor": 1, "out_leak_factor": 1}
    if (reset := one("zero", "subtract", "delayed")) == "delayed":
        leaks |= {"synapse_shift": 0, "synapse_factor": 1, "out_synapse_shift": 0, "out_synapse_factor": 1}
    stacks = ([], [[0, 4, []], [4, 12, [0]]], [[0, 3, [0]], [3, 5, [0, 1]], [5, 12, [1]]])
    layers = stacks[rng.integers(len(stacks))]
    classes = one(1, 2, 6)
    config = ClassifierConfig(
        inputs=one(1, 3, 8), hidden=12 if layers else one(1, 5, 12), layers=layers,
        classes=classes, in_bits=one(2, 4, 8), rec_bits=one(2, 4, 8),
        out_bits=one(2, 4, 8), bias_bits=one(2, 9), in_shift=one(0, 2), rec_shift=one(0, 3), bias_shift=one(0, 1),
        out_shift=one(0, 2), out_bias_shift=one(0, 1), membrane_bits=one(7, 9, 20), output_bits=one(7, 9, 20),
        evidence_bits=one(4, 8, 24), threshold=one(1, 20, 60), out_threshold=one(1, 20, 60), floor=one(None, 0, -30),
        out_floor=one(None, 0, -30), neuron_reset=reset, readout=one("spikes", "membrane"),
        own_parameters=own, margin=one(0, 1, 3, 15) if classes > 1 else 0, **leaks,
    )  # fmt: skip

    def weights(bits: int, *shape: int) -> Any:
        return rng.integers(lowest(bits), highest(bits) + 1, shape)

    return IntegerNetwork.filled(config, weights)


def test_classifiers_have_the_same_potentials_spikes_evidence_and_class(holdout: int) -> None:
    for seed in range(holdout, holdout + 4 * RUNS):
        rng = np.random.default_rng(seed)
        first = network_draw(rng)
        second, state = network_of(first), State(first)
        for _ in range(12):
            channels = rng.integers(0, first.config.inputs, int(rng.integers(0, 9))).tolist()
            state.add_events(channels)
            of_first = state.end_single_bin()
            winner, evidence, hidden, fired, outputs = second.run_bin(channels)
            assert hidden == of_first.potential.tolist(), (seed, first.config)
            assert fired == np.flatnonzero(of_first.spikes).tolist(), seed
            assert outputs == of_first.output.tolist(), (seed, first.config)
            assert evidence == of_first.evidence.tolist(), seed
            assert winner == of_first.winner, seed
            assert second.sure == of_first.sure, seed
