"""Compare the test pattern's RTL with its model in every clock: modes, rates, restarts, random grants."""

from __future__ import annotations

from typing import Any

import cocotb

from eskin.cocotb_tests.bench.block import begin, report
from eskin.model.registers import pattern

CLOCKS = 2500


@cocotb.test()
async def pattern_follows_its_model(dut: Any) -> None:
    """Play every mode at several rates, with early, late and spurious grants."""
    config, rng, block, check = begin(dut)
    state, now = pattern.new_state(), pattern.Pattern()
    block.drive(restart=0, granted=0, **now._asdict())
    await block.reset()
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
        granted = 1 << state[pattern.ROW] if rng.random() < willing else 1 << rng.randrange(config.rows)
        taken = bool(asks and granted >> state[pattern.ROW] & 1)
        block.drive(restart=restart, granted=granted, **now._asdict())
        await block.settle()
        told = (now, state)
        check.equal("testing", now.mode != 0, block.read("testing"), told)
        check.equal("row_request", asks << state[pattern.ROW], block.read("row_request"), told)
        column = 1 << state[pattern.COLUMN]
        check.equal("column_request", column, block.read("column_request"), told)
        if config.has_polarity:
            sign = column if state[pattern.SIGN] else 0
            check.equal("column_polarity", sign, block.read("column_polarity"), told)
        check.counts["taken"] += taken
        check.counts["waits"] += asks and not taken
        check.counts["withdrawn"] += restart and state[pattern.REQUEST] == 1
        await block.edge()
        pattern.advance(state, now, (config.rows, config.columns), restart, taken)
    report(check.counts)
