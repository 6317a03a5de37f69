"""Testbench of the frame readout: behavioural ADC, receiver, and comparison with the model."""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.cocotb_tests.bench.block import Block, BlockMismatch, Checker, Sink
from eskin.model.frame import FrameModel, Inputs, Outputs
from eskin.model.frame_config import FrameConfig
from eskin.model.frame_words import adc_code, unpack


class SarAdc:
    """Behavioural SAR ADC: samples at the end of ``adc_start``, then answers after a number of clocks.

    The timing "fixed" takes N + 1 clocks, and "random" 1 to 2 N clocks. "level" takes N + 1 clocks, and holds
    ``adc_done`` and the code until the next start. While no code is valid, the code is random.
    """

    TIMINGS = ("fixed", "random", "level")

    def __init__(self, config: FrameConfig, timing: str, rng: random.Random) -> None:
        self.config, self.timing, self.rng = config, timing, rng
        self.remaining = 0
        self.code: int | None = None

    def outputs(self) -> tuple[int, int]:
        """Return adc_done and adc_code in this clock."""
        if self.remaining == 0 and self.code is not None:
            return 1, self.code
        return 0, self.rng.getrandbits(self.config.resolution)

    def clock(self, start: bool, sample: int) -> None:
        """Apply a rising edge; ``sample`` is the signal at the multiplexer's output."""
        if self.remaining:
            self.remaining -= 1
            if start:
                raise BlockMismatch("adc_start while a conversion is under way")
        elif self.timing != "level":
            self.code = None
        if start:
            bits = self.config.resolution
            self.code = self.convert(sample)
            self.remaining = (self.rng.randint(1, 2 * bits) if self.timing == "random" else bits + 1) - 1

    def convert(self, sample: int) -> int:
        """Return the N-bit code, by one comparison of the sample with the DAC per bit."""
        weight = self.config.readout.full_scale
        dac, code = -weight, 0
        for _ in range(self.config.resolution):
            above = sample >= dac + weight
            dac += weight if above else 0
            code = code << 1 | above
            weight >>= 1
        return code ^ 1 << (self.config.resolution - 1)  # two's complement


class FrameBench:
    """A frame readout with array, ADC and receiver, compared with the model in every clock.

    Independent of the model, the samples that the ADC took are collected, and in the end the received words must
    unpack to their codes: every one once and in order.
    """

    def __init__(self, dut: Any, config: FrameConfig, rng: random.Random) -> None:
        self.config, self.rng = config, rng
        self.block = Block(dut)
        self.check = Checker(self.block)
        self.model = FrameModel(config)
        self.samples: Callable[[int], NDArray[np.int64]] = lambda clock: np.zeros(config.taxels, np.int64)
        self.history: deque[str] = deque(maxlen=6)
        self.begin("fixed", "always")
        self.block.drive(frame_start=0, adc_done=0, adc_code=0, word_ready=0, rst=1)

    def begin(self, timing: str, sink: str) -> None:
        """Begin with a new idle ADC and a new receiver, and clear the records of words and samples."""
        self.adc = SarAdc(self.config, timing, self.rng)
        self.sink = Sink(sink, self.rng)
        self.words: list[tuple[int, int]] = []
        self.taken: list[tuple[int, int]] = []
        self.selected, self.selected_for = (0, 0), 0
        self.offered: tuple[int, int] | None = None

    async def clock(self, start: bool = False, rst: bool = False) -> None:
        """Drive a clock, and compare all outputs just before its rising edge."""
        done, code = self.adc.outputs()
        inputs = Inputs(int(start), done, code, int(self.sink.ready()))
        self.block.drive(rst=rst, **inputs._asdict())
        if rst and self.config.reset == "async":
            self.model.reset()
        await self.block.settle()
        outputs = Outputs(*(self.block.read(name) for name in Outputs._fields))
        self.history.append(f"clock {self.block.time}: {inputs}, rst={int(rst)}")
        self.compare(outputs)
        if not rst:
            sample = self.watch(outputs, inputs)
            self.adc.clock(bool(outputs.adc_start), sample)
        await self.block.edge()
        if rst:
            self.model.reset()
        else:
            self.model.clock(inputs)

    def compare(self, outputs: Outputs) -> None:
        """Compare all outputs with the model."""
        self.check.counts["checks"] += 1
        expected = self.model.outputs
        if outputs == expected:
            return
        differ = [
            f"{name}: expected {a:#x}, got {b:#x}"
            for name, a, b in zip(Outputs._fields, expected, outputs, strict=True)
            if a != b
        ]
        state = {name: value for name, value in vars(self.model).items() if name != "config"}
        raise BlockMismatch(
            "\n".join([f"clock {self.block.time}: {'; '.join(differ)}", f"model: {state}", *self.history])
        )

    def watch(self, outputs: Outputs, inputs: Inputs) -> int:
        """Check the signals to multiplexer and ADC; return the signal at the multiplexer's output."""
        row, column = outputs.row_select, outputs.column_select
        one_hot = row & (row - 1) == 0 and column & (column - 1) == 0 and bool(row) == bool(column)
        self.check.holds("OneTaxelSelected", one_hot, f"row {row:#x}, column {column:#x}")
        self.selected_for = self.selected_for + 1 if self.selected == (row, column) else 0
        self.selected = (row, column)
        sample = 0
        if row:
            taxel = (row.bit_length() - 1) * self.config.columns + column.bit_length() - 1
            sample = int(self.samples(self.block.time)[taxel])
        if outputs.adc_start:
            settled = bool(row) and self.selected_for >= self.config.settle_clocks
            self.check.holds("MultiplexerSettled", settled, f"selected for {self.selected_for} clocks")
            self.taken.append((taxel, sample))
        if self.adc.remaining:
            self.check.holds("SelectedWhileConverting", self.selected_for > 0)
        word = (outputs.word_sync, outputs.word_data)
        if self.offered is not None:
            self.check.holds("WordStableUntilTaken", bool(outputs.word_valid) and word == self.offered, word)
        self.offered = word if outputs.word_valid and not inputs.word_ready else None
        if outputs.word_valid and inputs.word_ready:
            self.words.append(word)
        self.check.counts["overruns"] += outputs.frame_overrun
        return sample

    async def reset(self, clocks: int = 2) -> None:
        """Reset readout and ADC for a number of clocks."""
        self.begin(self.adc.timing, self.sink.name)
        for _ in range(clocks):
            await self.clock(start=True, rst=True)
        self.begin(self.adc.timing, self.sink.name)
        self.check.counts["resets"] += 1

    async def finish(self) -> None:
        """Wait until all words have left, and check that every sample left once and in order."""
        config = self.config
        limit = self.block.time + 40 * config.frame_clocks + 500
        while not self.model.idle:
            await self.clock()
            self.check.holds("Drains", self.block.time < limit, "words or conversions are outstanding")
        await self.clock()
        expected = [number % config.taxels for number in range(len(self.taken))]
        self.check.holds("EveryTaxelInOrder", [taxel for taxel, _ in self.taken] == expected, self.taken)
        samples = np.array([sample for _, sample in self.taken], np.int64).reshape(-1, config.taxels)
        sync, data = np.array(self.words, np.uint64).reshape(-1, 2).T
        received = unpack(config, data, sync.astype(bool))
        equal = len(data) == len(samples) * config.words_per_frame and np.array_equal(
            received, adc_code(config, samples)
        )
        self.check.holds("EverySampleOnceInOrder", equal, f"sampled {samples}, received {received}")
        self.check.counts["frames"] += len(received)
        self.check.counts["words"] += len(data)
        self.words, self.taken = [], []
