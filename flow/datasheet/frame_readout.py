"""Datasheet of the frame readout, with times and waveforms from the golden model."""

from typing import Any

from eskin.flow.datasheet.sheet import Picture, Sheet, Wave
from eskin.model.frame import FrameModel, Inputs
from eskin.model.frame_config import FrameConfig

SHOWN = 24
"""Clocks of a picture."""
STALLED = 2
"""Clocks in which the sink does not take the first word."""
AT_ADC = ("frame_start", "row_select", "column_select", "adc_start", "adc_done", "adc_code")
AT_SINK = ("frame_start", "frame_overrun", "adc_done", "word_valid", "word_ready", "word_data", "word_sync")
BUSES = ("row_select", "column_select", "adc_code", "word_data", "word_sync")
VALID = {"adc_code": "adc_done", "word_data": "word_valid", "word_sync": "word_valid"}
"""Signal that is high while a word is defined."""


class Scan:
    """Simulation of one frame, from ``frame_start`` at clock 0 to the next accepted start in clock ``heard``.

    The ADC takes its nominal clocks, and its codes count up. Without a stall the sink takes every word at once.
    With a stall the first word waits for ``STALLED`` clocks, and another ``frame_start`` comes too early there.
    """

    def __init__(self, config: FrameConfig, stall: int = 0) -> None:
        model, mask = FrameModel(config), (1 << config.resolution) - 1
        self.rows: list[dict[str, int]] = []  # values of all ports in every clock
        self.heard = done_at = code = 0
        left = stall
        while not (self.rows and model.idle):
            clock, found = len(self.rows), model.outputs
            waits = left > 0 and bool(found.word_valid)
            again = waits and left == stall and model.taxel >= 0
            given = Inputs(int(not clock or again), int(clock == done_at > 0), code & mask, int(not waits))
            left -= waits
            if found.adc_start:
                done_at, code = clock + config.adc_clocks, code + 1
            self.rows.append(given._asdict() | found._asdict())
            model.clock(given)
            if model.taxel < 0 and not self.heard:
                self.heard = clock + 1

    def first(self, name: str, behind: int = -1) -> int:
        """Return the first clock after ``behind`` in which an output is high."""
        return next(t for t, row in enumerate(self.rows) if t > behind and row[name])

    def waves(self, names: tuple[str, ...], start: int = 0, clocks: int | None = None) -> list[Wave]:
        """Return the waveforms of ports over a range of clocks."""
        shown = self.rows[start : None if clocks is None else start + clocks]
        found = []
        for name in names:
            valid = VALID.get(name)
            values = tuple(int(row[name]) if valid is None or row[valid] else None for row in shown)
            found.append(Wave(name, values, bus=name in BUSES))
        return found


def sheet_of(config: FrameConfig, report: dict[str, Any] | None) -> Sheet:
    """Return the datasheet of a frame readout, optionally with netlist results."""
    scan, stalled = Scan(config), Scan(config, STALLED)
    start = Picture("start", "From frame_start to the ADC", scan.waves(AT_ADC, 0, SHOWN))
    begin = max(stalled.first("word_valid") - 8, 0)
    word = Picture("word", "The first word of a frame", stalled.waves(AT_SINK, begin, SHOWN), begin)
    values = {"scan": scan, "stalled": STALLED, "latencies": _times(config, scan), "report": report}
    what = f"{config.rows} x {config.columns} taxels, {config.resolution} b, words of {config.word_bits} b"
    return Sheet(config, what, "frame_readout.md", values, (start, word))


def _times(config: FrameConfig, scan: Scan) -> list[tuple[str, int]]:
    """Return the latencies in clocks."""
    first = scan.first("adc_start")
    last = max(t for t, row in enumerate(scan.rows) if row["word_valid"])
    next_taxel = [("from one taxel to the next", scan.first("adc_start", first) - first)] if config.taxels > 1 else []
    return [
        ("`frame_start` to `row_select` and `column_select`", scan.first("row_select")),
        ("`frame_start` to the first `adc_start`", first),
        *next_taxel,
        ("`frame_start` to the first word", scan.first("word_valid")),
        ("`frame_start` to the last word", last),
        ("`frame_start` to the next accepted `frame_start`", scan.heard),
    ]
