"""Compare both models: events, clocks, order, polarity, final registers, frames and classes.

The second model imports nothing of the project.

Configurations and stimuli are drawn anew in every run (conftest.py prints the seed).
"""

import ast
import dataclasses
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eskin.cocotb_tests import independent
from eskin.cocotb_tests.bench.draw import Draw
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

FILES = sorted(Path(str(independent.__file__)).parent.glob("*.py"))
RUNS = 20
"""Runs of one test; each has a seed of its own."""


def draws(holdout: int, part: int, **fields: Any) -> list[Draw]:
    return [
        Draw(1000 * holdout + RUNS * part + n, **({"most_taxels": 16, "clocks": 300} | fields)) for n in range(RUNS)
    ]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_the_second_imports_nothing_of_the_rest_of_the_project(path: Path) -> None:
    for node in ast.walk(ast.parse(path.read_text())):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        names += [str(node.module)] if isinstance(node, ast.ImportFrom) else []
        foreign = [name for name in names if not name.startswith("eskin.cocotb_tests.independent.")]
        assert {name.split(".")[0] for name in foreign} <= sys.stdlib_module_names


@pytest.mark.parametrize("part", range(6))
def test_both_give_the_same_events_and_registers(part: int, holdout: int) -> None:
    events = 0
    for draw in draws(holdout, part):
        assert not (found := differs(draw.config, draw.stimulus)), f"{draw}: {found}"
        events += len(simulate(draw.config, draw.stimulus))
    assert events > 0


def test_both_take_what_comparators_say_whatever_the_signal(holdout: int) -> None:
    for draw in draws(holdout, 6, set={"frontend": "analog"}):
        decisions = draw.rng("decisions").integers(0, 4, (draw.clocks, draw.config.taxels), dtype=np.uint8)
        decisions &= 3 if draw.config.has_polarity else 1
        given = dataclasses.replace(draw.stimulus, decisions=decisions)
        assert not (found := differs(draw.config, given)), f"{draw}: {found}"


def test_a_reset_in_any_clock_leaves_nothing_behind(holdout: int) -> None:
    for draw in draws(holdout, 7):
        first = draw.stimulus
        cut = dataclasses.replace(first, clocks=1 + int(draw.rng("cut").integers(draw.clocks)))
        _, readout = play(draw.config, cut)
        readout.clock(sample_valid=True, sample=[1] * draw.config.taxels, rst=True)
        assert not (found := differs(draw.config, first, readout)), f"{draw}: {found}"


def test_a_shorter_draw_is_the_beginning_of_a_longer_one(holdout: int) -> None:
    for draw in draws(holdout, 8):
        events = [simulate(draw.config, dataclasses.replace(draw, clocks=clocks).stimulus) for clocks in (200, 600)]
        before = events[1][events[1]["t"] < 199]
        assert before.tolist() == events[0][events[0]["t"] < 199].tolist(), draw


def test_skins_of_tiles_give_the_same_events(holdout: int) -> None:
    events = 0
    drawn = draws(holdout, 9, most_taxels=6, set={"frontend": "digital", "link": "stream"})[:9]  # 1 to 3 tiles a side
    for number, draw in enumerate(drawn):
        skin = TilesConfig.of(draw.config.replace(registers="none", fields="own"), 1 + number % 3, 1 + number // 3)
        of_tiles = [dataclasses.replace(draw, run=run).stimulus.samples for run in range(skin.tiles)]
        ticks = min(map(len, of_tiles))
        first = dataclasses.replace(draw.stimulus, sample_clock=draw.stimulus.sample_clock[:ticks])
        stimuli = [dataclasses.replace(first, samples=samples[: len(first.sample_clock)]) for samples in of_tiles]
        expected = simulate_skin(skin, stimuli)
        found = first_difference(expected, play_skin(skin, stimuli))
        assert found is None, f"{draw}, {skin.tile_rows} x {skin.tile_columns} tiles: {found}"
        events += len(expected)
    assert events > 0


def frame_configs(holdout: int) -> Iterator[FrameConfig]:
    for draw in draws(holdout, 10, set={"registers": "none", "fields": "own"}, most_taxels=9):
        rng = draw.rng("frames")
        bits, settle = int(rng.integers(draw.config.resolution, 33)), int(rng.choice([1, 2, 5]))
        yield FrameConfig(readout=draw.config, word_bits=bits, settle_clocks=settle)


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


def test_frames_have_the_same_words_starts_and_overruns(holdout: int) -> None:
    for number, config in enumerate(frame_configs(holdout)):
        stimulus = frame_stimulus(config, np.random.default_rng([holdout, number]))
        words, starts, missed = play_frames(config, stimulus)
        run = simulate_frames(config, stimulus)
        assert words == run.words.tolist(), config
        assert starts == [tuple(start) for start in run.starts.tolist()], config
        assert missed == run.overruns.tolist(), config
        assert words


def network_draw(rng: np.random.Generator) -> IntegerNetwork:
    def one(*values: Any) -> Any:
        value = rng.choice(np.array(values, object))
        return value

    def leak() -> tuple[int, int]:
        shift = one(0, 1, 4)
        return shift, one(1, *range(2, 2**shift + 1))

    config = ClassifierConfig(
        inputs=one(1, 3, 8), hidden=one(1, 5, 12), classes=one(1, 2, 6), in_bits=one(2, 4, 8), rec_bits=one(2, 4, 8),
        out_bits=one(2, 4, 8), bias_bits=one(2, 9), in_shift=one(0, 2), rec_shift=one(0, 3), bias_shift=one(0, 1),
        out_shift=one(0, 2), out_bias_shift=one(0, 1), membrane_bits=one(7, 9, 20), output_bits=one(7, 9, 20),
        evidence_bits=one(4, 8, 24), threshold=one(1, 20, 60), out_threshold=one(1, 20, 60), floor=one(None, 0, -30),
        out_floor=one(None, 0, -30), neuron_reset=one("zero", "subtract"), readout=one("spikes", "membrane"),
        **{f"{name}_{part}": value for name in LEAKS for part, value in zip(("shift", "factor"), leak(), strict=True)},
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
