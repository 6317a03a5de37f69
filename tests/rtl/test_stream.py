"""Test rtl/stream.py: events of the readout with streams, and conversion to Verilog by Amaranth."""

import os
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from amaranth.sim import Simulator

from eskin.base.errors import InputError
from eskin.model.address_events import make_events
from eskin.model.config import ReadoutConfig
from eskin.model.readout import Stimulus, simulate
from eskin.rtl.stream import StreamReadout

SMALL = ReadoutConfig(rows=2, columns=3, resolution=3, clocks_per_sample=8)
CASES = [SMALL, SMALL.replace(rows=1, columns=2, encoding="nlcs", leak_shift=2, leak_period=2)]


@pytest.mark.representative("lcs", block="stream")
@pytest.mark.parametrize("config", CASES, ids=["lcs-2x3", "nlcs-1x2"])
def test_streams_carry_the_events_of_the_model_to_a_consumer_that_stalls(config: ReadoutConfig) -> None:
    rng = np.random.default_rng(7)
    samples = rng.integers(-config.full_scale, config.full_scale, (12, config.taxels))
    ready = (rng.random(16) < 0.4).astype(np.uint8)
    stimulus = Stimulus.from_samples(config, samples, clocks=200, ready=ready)
    top = StreamReadout(config)
    seen: list[tuple[int, int, int, bool]] = []

    async def bench(ctx: Any) -> None:
        for clock in range(stimulus.clocks):
            tick, phase = divmod(clock, config.clocks_per_sample)
            valid = phase == 0 and tick < len(samples)
            ctx.set(top.samples.valid, valid)
            ctx.set(top.samples.payload, samples[tick].tolist() if valid else [0] * config.taxels)
            ctx.set(top.events.ready, int(ready[clock % len(ready)]))
            assert ctx.get(top.samples.ready)
            if ctx.get(top.events.valid) and ready[clock % len(ready)]:
                event = ctx.get(top.events.payload)
                fields = {name: int(event[name]) for name in event.shape()._fields}
                seen.append((clock, fields.get("row", 0), fields.get("col", 0), bool(fields.get("polarity", 1))))
            await ctx.tick()

    simulator = Simulator(top)
    simulator.add_clock(1e-6)
    simulator.add_testbench(bench)
    simulator.run()
    expected = simulate(config, stimulus)
    assert len(expected) > 20
    assert np.array_equal(make_events(*np.array(seen).T), expected)


def test_amaranth_finds_the_pinned_yosys() -> None:
    """Test that Amaranth finds the pinned Yosys without the variable YOSYS and without Yosys in PATH."""
    program = (
        "from amaranth.back import verilog; from eskin import ReadoutConfig, StreamReadout\n"
        "print(verilog.convert(StreamReadout(ReadoutConfig(rows=1, columns=2, resolution=2, sample_bits=4))))"
    )
    bare = {name: os.environ[name] for name in ("HOME", "PYTHONPATH") if name in os.environ} | {"PATH": "/usr/bin:/bin"}
    done = subprocess.run([sys.executable, "-c", program], env=bare, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    for port in ("samples__payload", "samples__valid", "events__payload", "events__valid", "events__ready"):
        assert f" {port};" in done.stdout


@pytest.mark.parametrize(
    ("field", "sentence"),
    [
        ({"frontend": "analog"}, "a sample stream needs frontend 'digital', not 'analog'"),
        ({"link": "four_phase"}, "an event stream needs link 'stream', not 'four_phase'"),
    ],
)
def test_a_stream_readout_refuses_other_links_and_front_ends(field: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        StreamReadout(SMALL.replace(**field))
