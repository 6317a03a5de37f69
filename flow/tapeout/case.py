"""Test case for a shuttle project: frames of samples, and expected events from the golden model."""

from typing import Any

import numpy as np

from eskin.flow.datasheet.waves import address
from eskin.flow.tapeout.pins import CLOCKS_PER_BIT
from eskin.model.config import ReadoutConfig
from eskin.model.readout import Stimulus, simulate
from eskin.model.registers.description import registers

FRAMES, REFUSED = 24, 5
"""Number of frames of a test, and the index of the frame that lacks a bit."""
BEFORE, AFTER = 4, 6
"""Clocks from the fall of CS to the first bit, and from the last bit to the rise of CS and beyond."""
TAKEN = 4
"""Clocks from the last fall of SCK to the clock in which the readout takes the frame: CS rises behind two, and passes
two flops."""
SETTLED = 900
"""Clocks after reset in which the test accesses registers, for each register."""
ACK_EIGHTHS = 4
"""The host answers at falling edges, half a clock after the request."""


def case(config: ReadoutConfig) -> dict[str, Any]:
    """Return stimulus and expected events for test.py as a dictionary."""
    rng = np.random.default_rng(1)
    top = (1 << config.sample_bits - 1) - 1
    walk = np.cumsum(rng.integers(-3 * config.step, 3 * config.step + 1, (FRAMES, config.taxels)), axis=0)
    codes = np.clip(walk, -top, top).astype(np.int32)
    named = {register.key: register for register in registers(config)}
    constants = [[named[key].address, named[key].reset] for key in ("id", "shape")]
    settings = [[named[key].address, named[key].reset] for key in ("resolution",)]

    bits = config.taxels * config.sample_bits
    length = BEFORE + CLOCKS_PER_BIT * bits + AFTER
    spacing = length + 8 * 2 * config.taxels + 40  # every taxel may send twice
    start = SETTLED * (len(constants) + 2 * len(settings))
    starts = start + spacing * np.arange(FRAMES)
    missing = (np.arange(FRAMES) == REFUSED).astype(int)
    taken = starts + BEFORE + CLOCKS_PER_BIT * bits + TAKEN
    whole = missing == 0
    end = int(starts[-1] + spacing)
    stimulus = Stimulus(
        samples=codes[whole],
        sample_clock=taken[whole],
        clocks=end,
        enable_clock=np.zeros(1, np.int64),
        enable=np.ones((1, config.taxels), np.bool_),
        ack_delay=np.full(1, ACK_EIGHTHS, np.int64),
    )
    events, dual = simulate(config, stimulus), config.protocol.request_has_polarity
    return {
        "config": config.to_dict(),
        "requests": 1 + dual,
        "period_ns": 2 * round(5e8 / config.clock_hz),
        "clocks_low": [4, 2],
        "sample_bits": config.sample_bits,
        "constants": constants,
        "settings": settings,
        "counter": named["events"].address,
        "frames": [
            {
                "clock": int(clock),
                "missing_bits": int(short),
                "codes": (row & (1 << config.sample_bits) - 1).tolist(),
            }
            for clock, short, row in zip(starts, missing, codes, strict=True)
        ],
        "end": end,
        "events": [  # clock, request, address
            [int(event["t"]), int(event["p"]) if dual else 0, address(config, event) & (1 << config.address_bits) - 1]
            for event in events
        ],
    }
