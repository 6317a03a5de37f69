"""Generate a testbench beside the Verilog: samples, and expected events from the model."""

from pathlib import Path

import numpy as np

from eskin.base.pages import templates
from eskin.model.address_events import Events
from eskin.model.config import ReadoutConfig
from eskin.model.readout import Stimulus, simulate

TEMPLATES = templates(Path(__file__).parents[1] / "templates")
TICKS = 8
"""Sample ticks that are played."""


def has_testbench(config: object) -> bool:
    """Return True if a design has a testbench, which needs a digital front end and a stream link."""
    if type(config) is not ReadoutConfig:  # a skin of tiles is one too, with other ports
        return False
    return config.frontend == "digital" and config.protocol.streams and config.registers == "none"


def _played(config: ReadoutConfig) -> tuple[list[int], Events]:
    """Return the samples of every tick as one word, and the expected events."""
    full = 1 << (config.sample_bits - 1)
    taxel = np.arange(config.taxels)
    levels = np.arange(1, TICKS + 1)[:, None] * (taxel % 5 + 2) * config.step // 8
    samples = np.clip(levels * np.where(taxel % 3 == 2, -1, 1), -full, full - 1).astype(np.int32)
    events = simulate(config, Stimulus.from_samples(config, samples))
    mask = (1 << config.sample_bits) - 1
    words = [sum((int(value) & mask) << (i * config.sample_bits) for i, value in enumerate(row)) for row in samples]
    return words, events


def testbench(config: ReadoutConfig, tied: str = "") -> str:  # noqa: PT028
    """Return a SystemVerilog testbench that plays samples and compares every event with the model.

    It prints one line with PASSED or FAILED, and ends with ``$fatal`` where an event is missing, wrong or too much:
    the simulator then returns an error. ``tied`` is an input that is low: the test enable of clock gates.
    """
    samples, events = _played(config)
    fields = {"polarity": int(config.has_polarity), "row": config.row_bits, "col": config.column_bits}
    present = [(f"event_{name}", bits) for name, bits in fields.items() if bits]
    row, column = events["y"].astype(int), events["x"].astype(int)
    expected = ((events["p"] * config.has_polarity << config.row_bits | row) << config.column_bits | column).tolist()
    return TEMPLATES.get_template("testbench.sv").render(
        config=config,
        ticks=TICKS,
        wide=config.taxels * config.sample_bits,
        width=max(1, sum(bits for _, bits in present)),
        seen="{" + ", ".join(name for name, _ in present) + "}" if present else "1'b0",
        present=present,
        samples=samples,
        expected=expected,
        count=len(expected),
        tied=tied,
    )
