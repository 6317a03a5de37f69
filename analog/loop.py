"""Compare the delivered Verilog, driven by comparators of transistors, with the golden model."""

import dataclasses
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from eskin.analog.bench import RESULT
from eskin.analog.circuit import FrontEnd
from eskin.cocotb_tests.bench.block import JOB
from eskin.cocotb_tests.runner.simulator import build
from eskin.model.address_events import Events, make_events
from eskin.model.config import ReadoutConfig
from eskin.model.readout import Stimulus, simulate, strobes

MODULE = "eskin.analog.bench"


Happened = list[tuple[int, str]]
"""What happened in which clock."""


@dataclass(frozen=True)
class Loop:
    """What happened in a loop of taxels and Verilog."""

    events: Events  # of the Verilog
    expected: Events  # of the golden model, with the decisions of the loop
    strobes: NDArray[np.bool_]  # of the Verilog, shape (clocks, taxels)
    expected_strobes: NDArray[np.bool_]

    @property
    def happened(self) -> Happened:
        """Events and strobes of the Verilog, by clock."""
        return happened(self.events, self.strobes)

    @property
    def should_happen(self) -> Happened:
        """Events and strobes of the model, by clock."""
        return happened(self.expected, self.expected_strobes)

    @property
    def different(self) -> int:
        """Number of events and strobes that only the Verilog or only the model has."""
        return len({*self.happened} ^ {*self.should_happen})


def happened(events: Events, strobes: NDArray[np.bool_]) -> Happened:
    """Return events and strobes in the order of their clocks, as text that shows where two lists differ."""
    found = [(int(clock), f"compare of taxel {taxel}") for clock, taxel in np.argwhere(strobes)]
    return sorted(found + [(t, f"{'ON' if p else 'OFF'} event of ({y}, {x})") for t, x, y, p in events.tolist()])


def play(
    config: ReadoutConfig,
    front_end: FrontEnd,
    signal: NDArray[np.float64],
    folder: Path,
    *,
    gain: float = 1.0,
    offsets_v: NDArray[np.float64] | None = None,
    noise_v: float | None = None,
    code: str = "",
) -> Loop:
    """Play a signal through the comparators and the Verilog, in Icarus.

    Parameters
    ----------
    signal : ndarray
        Codes, with fractions, of shape (ticks, taxels).
    gain : float
        Gain of the DAC, as the characterisation measured it.
    offsets_v : ndarray, optional
        Offsets of the comparators for ON and OFF in volts, shape (taxels, 2).
    noise_v : float, optional
        Replace the transistors by behavioural comparators with ``offsets_v`` and this rms noise in volts.
    code : str
        Version of the sources. Decisions are stored in the folder; a loop of the same version takes them from there.
    """
    folder.mkdir(parents=True, exist_ok=True)
    np.save(folder / "signal.npy", signal)
    job = {
        "config": config.to_dict(),
        "front_end": front_end.to_dict(),
        "signal": str((folder / "signal.npy").resolve()),
        "gain": gain,
        "offsets_v": (np.zeros((config.taxels, 2)) if offsets_v is None else offsets_v).tolist(),
        "noise_v": noise_v,
        "code": code,
    }
    build(config, "icarus", top="eskin_readout").test(MODULE, folder, "play", {JOB: json.dumps(job)})
    with np.load(folder / RESULT) as found:
        decisions, (t, y, x, p), asked = found["decisions"], found["events"].T, found["strobes"]
    stimulus = Stimulus.from_samples(config, np.zeros(signal.shape, np.int32))  # the model sees the decisions alone
    stimulus = dataclasses.replace(stimulus, decisions=decisions)
    polarity = p if config.has_polarity else np.ones_like(p)
    expected = simulate(config, stimulus), strobes(config, stimulus)
    return Loop(make_events(t, y, x, polarity), expected[0], asked, expected[1])
