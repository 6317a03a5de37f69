"""Properties of the frame readout: order of taxels, no lost word, exact overrun flag."""

from typing import Any

from amaranth.hdl import Array, Cat, Const, Module, Mux, Signal

from eskin.model.frame_config import FrameConfig
from eskin.rtl.frame import FrameReadout
from eskin.verify.proofs.checker import Checker, Promises, before, implies, pick


class FrameChecker(Checker[FrameConfig]):
    """Checker of the frame readout; ADC and sink are free.

    ``watch`` is any bit of a frame's words, for good.
    """

    block = FrameReadout

    def constants(self, config: FrameConfig) -> dict[str, int]:
        return {"watch": config.words_per_frame * config.word_bits}

    def check(self, m: Module) -> Promises:
        rows, columns, settle = self.config.rows, self.config.columns, self.config.settle_clocks
        row, column = Signal(rows, init=1, name="row_now"), Signal(columns, init=1, name="column_now")
        scan, converting = Signal(), Signal()
        taken = converting & self.adc_done
        last = taken & row[-1] & column[-1]
        m.d.sync += [
            scan.eq((scan | self.frame_start) & ~last),
            converting.eq((converting | self.adc_start) & ~taken),
        ]
        with m.If(taken):
            m.d.sync += column.eq(Cat(column[-1], column[:-1]))
            with m.If(column[-1]):
                m.d.sync += row.eq(Cat(row[-1], row[:-1]))
        selected = (self.row_select == (row & scan.replicate(rows))) & (
            self.column_select == (column & scan.replicate(columns))
        )
        yield "taxels_in_order", selected, self.adc_start & row[-1] & column[-1]
        yield "one_conversion_each", implies(self.adc_start, scan & ~converting), self.adc_start
        waited = self.count_to(m, settle + 5, ~scan | converting, 1)
        yield "settled", implies(self.adc_start, waited >= settle), self.adc_start & (waited == settle)
        stuck = self.count_to(m, settle + 5, ~scan | converting | self.adc_start | ~self.word_ready, 1)
        yield "scan_goes_on", stuck < settle + 3, self.adc_start
        missed = before(m, self.frame_start & scan, "missed")
        yield "overrun_exact", self.frame_overrun == missed, missed & ~scan
        yield from self._words(m, taken, last, row, column)

    def _words(self, m: Module, taken: Any, last: Any, row: Signal, column: Signal) -> Promises:
        """Track one bit of a frame from its code to its word."""
        config = self.config
        bits, width, count = config.resolution, config.word_bits, config.words_per_frame
        leaves = self.word_valid & self.word_ready
        number = Signal(range(count), name="word_number")
        ends = leaves & (number == count - 1)
        with m.If(leaves):
            m.d.sync += number.eq(Mux(ends, 0, number + 1))
        into, out = Signal(name="frame_in"), Signal(name="frame_out")
        m.d.sync += [into.eq(into ^ last), out.eq(out ^ ends)]

        places = range(count * width)
        codes = config.taxels * bits
        mine = [
            row[place // bits // config.columns] & column[place // bits % config.columns] if place < codes else Const(0)
            for place in places
        ]
        padding = [Const(1, 1)] * ((1 << len(self.watch)) - count * width)
        kept = Array(Signal(name=f"bit_{frame}") for frame in range(2))
        with m.If(taken & Array([*mine, *padding])[self.watch]):
            sent = Array([*(self.adc_code[place % bits] for place in places), *padding])[self.watch]
            m.d.sync += kept[into].eq(sent)
        real = self.watch < codes
        due = self.word_valid & pick([number == place // width for place in places], self.watch)
        shown = Array([*(self.word_data[place % width] for place in places), *padding])[self.watch]
        yield "words_carry_codes", implies(due, shown == (kept[out] & real)), due & shown
        yield "sync_on_first", implies(self.word_valid, self.word_sync == (number == 0)), ends
        behind = self.count_to(m, 5, (into == out) | ~self.word_ready | ends, 1)
        yield "frame_completes", behind < 4, (into != out) & ends
        word = Cat(self.word_data, self.word_sync)
        yield "word_stable", *self.unchanged(m, self.word_valid, self.word_ready, word)
