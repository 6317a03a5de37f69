"""Compare the event order of model and RTL arbiter for every pattern of requests of small arrays."""

import numpy as np
import pytest
from amaranth.hdl import Cat, Module, Signal
from amaranth.sim import Simulator

from eskin.model import arbiter as model
from eskin.model.config import ReadoutConfig
from eskin.rtl.arbiter import Arbiter


def polarities(pattern: int, taxels: int) -> int:
    """Return a polarity for every taxel, different for every pattern."""
    return pattern * 2654435761 >> 7 & ((1 << taxels) - 1)


def model_orders(config: ReadoutConfig) -> list[list[int]]:
    """Return the events of the model as 2 * taxel + polarity, one list per last row and pattern."""
    rows, columns = config.rows, config.columns
    orders = []
    for last in range(rows):
        for pattern in range(1, 1 << config.taxels):
            state, lines = model.new_state(), np.zeros(rows, model.ROW_DTYPE).view(np.recarray)
            order = []
            for word in (1 << last * columns, pattern):
                for row in range(rows):
                    lines[row].pending = word >> row * columns & ((1 << columns) - 1)
                    lines[row].polarity = polarities(word, config.taxels) >> row * columns & ((1 << columns) - 1)
                    if lines[row].pending:
                        model.request(state, row)
                while not model.idle(state):
                    model.grant(state, lines)
                    order.append(int(model.take(state, columns)))
            orders.append(order)
    return orders


def rtl_orders(config: ReadoutConfig) -> list[list[int]]:
    """Return the events of the RTL as 2 * taxel + polarity, one list per last row and pattern; the sink is ready."""
    rows, columns = config.rows, config.columns
    m = Module()
    m.submodules.arbiter = arbiter = Arbiter(config)
    request, polarity = Signal(config.taxels), Signal(config.taxels)
    words = [slice(row * columns, (row + 1) * columns) for row in range(rows)]
    gates = [arbiter.select[row].replicate(columns) for row in range(rows)]
    m.d.comb += [
        arbiter.event_ready.eq(1),
        arbiter.row_request.eq(Cat(request[word].any() for word in words)),
        arbiter.column_request.eq(Cat(request[word] & gate for word, gate in zip(words, gates, strict=True))),
        arbiter.column_polarity.eq(Cat(polarity[word] & gate for word, gate in zip(words, gates, strict=True))),
    ]
    granted = Cat(arbiter.granted[row].replicate(columns) for row in range(rows))
    m.d.sync += request.eq(request & ~granted)
    row = arbiter.event_row if config.row_bits else 0
    column = arbiter.event_col if config.column_bits else 0
    event = Signal(range(2 * config.taxels))
    m.d.comb += event.eq((row * columns + column) * 2 + arbiter.event_polarity)
    orders: list[list[int]] = []

    async def drive(context: object) -> None:
        for last in range(rows):
            for pattern in range(1, 1 << config.taxels):
                order = []
                for word in (1 << last * columns, pattern):
                    context.set(request, word)  # type: ignore[attr-defined]
                    context.set(polarity, polarities(word, config.taxels))  # type: ignore[attr-defined]
                    count = word.bit_count() + 1  # one clock to be latched
                    for clock in range(count):
                        if clock:
                            assert context.get(arbiter.event_valid), (last, pattern)  # type: ignore[attr-defined]
                            order.append(context.get(event))  # type: ignore[attr-defined]
                        await context.tick()  # type: ignore[attr-defined]
                    assert not context.get(arbiter.event_valid)  # type: ignore[attr-defined]
                orders.append(order)

    simulator = Simulator(m)
    simulator.add_clock(1e-6)
    simulator.add_testbench(drive)
    simulator.run()
    return orders


@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (1, 4), (4, 1), (2, 2), (2, 3), (3, 2), (3, 3)])
def test_every_pattern_of_requests_leaves_in_the_same_order(rows: int, columns: int) -> None:
    config = ReadoutConfig(rows=rows, columns=columns)
    expected = model_orders(config)
    assert len(expected) == rows * ((1 << config.taxels) - 1)
    assert rtl_orders(config) == expected
