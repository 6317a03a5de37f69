"""Compare the arbiter's RTL with the independent model in every clock, for all kinds of demand and sinks.

The proofs of ``eskin.verify.proofs.blocks.arbiter`` have its whole contract.
"""

import itertools
import random
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from eskin.cocotb_tests.bench.block import Sink, Step, bits, payload
from eskin.cocotb_tests.independent.arbiter import Arbiter
from eskin.cocotb_tests.runner.block import play_steps
from eskin.model.config import ReadoutConfig

CLOCKS = 150


def steps(config: ReadoutConfig, rng: random.Random, counts: Counter[str]) -> Iterator[Step]:
    """Yield groups of taxels with few and with many requests, masks and resets, against all kinds of sinks.

    A request stays until its row is granted or its taxel is masked, and a selected row drives the column lines in the
    same clock.
    """
    columns, arbiter = config.columns, Arbiter(config.rows, config.columns)
    off: list[int | None] = [None] * columns
    everyone = list(itertools.product(range(config.rows), range(columns)))
    row, column = rng.choice(everyone)
    groups = [everyone, [(row, n) for n in range(columns)], [(n, column) for n in range(config.rows)], [(row, column)]]
    groups.append(sorted(rng.sample(everyone, min(5, len(everyone)))))
    phases = itertools.product(groups, ((1.0, 0.0), (0.02, 0.0), (0.3, 0.1)))
    for (group, (demand, masked)), sink_name in zip(phases, itertools.cycle(Sink.NAMES), strict=False):
        sink = Sink(sink_name, rng)
        requests: list[list[int | None]] = [off.copy() for _ in range(config.rows)]
        for clock in range(CLOCKS):
            rst, ready = clock == CLOCKS - 1, sink.ready()
            for r, c in everyone:
                if requests[r][c] is not None and rng.random() < masked:
                    requests[r][c] = None
            for r, c in group:
                if requests[r][c] is None and rng.random() < demand:
                    requests[r][c] = rng.getrandbits(1) if config.has_polarity else 1
            if rst and config.reset == "async":
                arbiter.reset()
            event, granted, chosen = arbiter.output(), arbiter.granted_row(requests, ready), arbiter.next_row(requests)
            one_hot = {"select": chosen, "granted": granted}
            outputs = {name: 0 if row is None else 1 << row for name, row in one_hot.items()}
            outputs |= {"event_valid": event is not None, **(payload(config, *event) if event else {})}
            inputs = {"row_request": bits([line != off for line in requests]), "event_ready": ready, "rst": rst}
            inputs |= {"column_request": 0, "column_polarity": 0}
            if chosen is not None:
                asking = bits([polarity is not None for polarity in requests[chosen]])
                polarity = bits(requests[chosen]) | rng.getrandbits(columns) & ~asking
                inputs["column_request"] = asking << chosen * columns
                inputs["column_polarity"] = polarity << chosen * columns
            yield Step(inputs, outputs, f"queue {arbiter.queue}, pointer {arbiter.pointer}, requests {requests}")
            counts["transfers"] += event is not None and ready
            counts["withheld"] += event is not None and not ready
            for r, c in arbiter.clock(requests, ready):
                requests[r][c] = None
            if rst:
                arbiter.reset()


CONFIGS = [
    ReadoutConfig(rows=1, columns=1, encoding="nlcs"),
    ReadoutConfig(rows=1, columns=1, reset="async"),
    ReadoutConfig(rows=1, columns=4),
    ReadoutConfig(rows=5, columns=1, encoding="nlcs", reset="async"),
    ReadoutConfig(rows=9, columns=5, encoding="cw-lcs"),
    ReadoutConfig(rows=2, columns=64, reset="async"),
    ReadoutConfig(rows=64, columns=2, encoding="nlcs"),
]


def name(config: ReadoutConfig) -> str:
    """Return the name of a configuration in the list of tests."""
    return f"{config.rows}x{config.columns}-{'bipolar' if config.has_polarity else 'unipolar'}-{config.reset}"


@pytest.mark.representative("icarus-9x5", block="arbiter")
@pytest.mark.parametrize("config", CONFIGS, ids=lambda config: f"icarus-{name(config)}")
def test_arbiter_keeps_its_contract_and_equals_its_reference(config: ReadoutConfig, tmp_path: Path) -> None:
    counts = play_steps(config, "icarus", "eskin_arbiter", steps, tmp_path, seed=2)
    assert counts["transfers"] > 300
    assert counts["withheld"] > 100, counts
    assert counts["checks"] >= 3 * 15 * CLOCKS
