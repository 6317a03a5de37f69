"""Steps of the test pattern: every mode at several rates, with early, late and spurious grants."""

import random
from collections import Counter
from collections.abc import Iterator

from eskin.cocotb_tests.bench.block import Step
from eskin.model.config import ReadoutConfig
from eskin.model.registers import pattern

CLOCKS = 2500


def steps(config: ReadoutConfig, rng: random.Random, counts: Counter[str]) -> Iterator[Step]:
    """Yield the inputs of the test pattern, and the outputs of its model."""
    state, now = pattern.new_state(), pattern.Pattern()
    willing = 1.0
    for _ in range(CLOCKS):
        restart = rng.random() < 0.01
        if restart:
            row, column = rng.randrange(config.rows), rng.randrange(config.columns)
            on, turns = (rng.randrange(2), rng.randrange(2)) if config.has_polarity else (1, 0)
            now = pattern.Pattern(
                rng.choice([0, 1, 1, 2, 2, 2]), on, turns, rng.choice([0, 0, 1, 2, 5, rng.randrange(16)]), row, column
            )
            willing = rng.choice([1.0, 0.3])
        asks = pattern.requests(state, restart)
        row, column = 1 << int(state[pattern.ROW]), 1 << int(state[pattern.COLUMN])
        granted = row if rng.random() < willing else 1 << rng.randrange(config.rows)
        taken = bool(asks and granted & row)
        outputs = {"testing": now.mode != 0, "row_request": int(asks) * row, "column_request": column}
        if config.has_polarity:
            outputs["column_polarity"] = column if state[pattern.SIGN] else 0
        yield Step({"restart": restart, "granted": granted, **now._asdict()}, outputs, f"{now}, {state}")
        counts["taken"] += taken
        counts["waits"] += bool(asks and not taken)
        counts["withdrawn"] += bool(restart and state[pattern.REQUEST] == 1)
        pattern.advance(state, now, (config.rows, config.columns), restart, taken)
