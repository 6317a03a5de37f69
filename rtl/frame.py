"""The frame-based baseline: a column-scan sequencer for one ADC, and a packer for the ADC codes."""

from typing import Any

from amaranth.hdl import Cat, Const, Module, Mux, Signal
from amaranth.lib.wiring import In, Out

from eskin.model.frame_config import FrameConfig
from eskin.model.frame_words import bit_positions
from eskin.rtl.block import Block
from eskin.rtl.links.link import READY
from eskin.rtl.logic import or_tree


class FrameSequencer(Block[FrameConfig]):
    """Sequencer that connects one taxel after the other to the ADC and forwards the codes.

    One-hot rings of flops, shifted once per conversion, drive the switches, which therefore cannot glitch. A conversion
    starts only while no sample waits, so there is always room for its code, and the ADC need not hold the code. An
    upset of a flop never stops the scan for good: a ring that has lost its bit ends its row or frame, and two flops
    together state that a conversion is running.

    Latency: ``frame_start`` at clock t, first ``adc_start`` at t + 1 + settle_clocks. Throughput: one taxel in
    settle_clocks + 1 + conversion clocks.

    Attributes
    ----------
    frame_start : In(1)
        Scan the array once; during a scan the sequencer misses it and reports an overrun.
    row_select, column_select : Out(rows), Out(columns)
        The taxel at the ADC, one-hot; 0 between frames.
    adc_start : Out(1)
        High for one clock; the ADC samples at the edge that ends it.
    adc_done, adc_code : In(1), In(N)
        The sequencer takes the code in the first clock after ``adc_start`` with ``adc_done``, a pulse or a level.
    sample_valid, sample_ready, sample_code, sample_first, sample_last
        The stream of codes, with the first and the last of a frame marked.
    frame_overrun : Out(1)
        The ``frame_start`` of the clock before was missed.
    awake : Out(1)
        Low in a clock at whose end no register of the sequencer changes: its clock may be stopped.
    """

    module_name = "eskin_frame_sequencer"

    def __init__(self, config: FrameConfig) -> None:
        super().__init__(
            config,
            {
                "frame_start": In(1),
                "row_select": Out(config.rows),
                "column_select": Out(config.columns),
                "adc_start": Out(1),
                "adc_done": In(1),
                "adc_code": In(config.resolution),
                **sample_ports(config, Out),
                "frame_overrun": Out(1),
                "awake": Out(1),
            },
        )

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        row = Signal(self.config.rows)
        column = Signal(self.config.columns)
        scanning = Signal()
        converting = Signal()
        started = Signal()
        resting = Signal(init=1)
        settling = Signal(range(self.config.settle_clocks + 1))
        held = Signal()
        overrun = Signal()
        first, last = Signal(), Signal()
        code = Signal(self.config.resolution)

        taken = Signal()
        row_ends = Signal()
        frame_ends = Signal()
        m.d.comb += [
            self.row_select.eq(row),
            self.column_select.eq(column),
            self.adc_start.eq(scanning & ~converting & (settling == 0) & ~held),
            row_ends.eq(~column[:-1].any()),
            frame_ends.eq(row_ends & ~row[:-1].any()),
            converting.eq(started & ~resting),  # after a bit flip, the sequencer must not wait for a code
            taken.eq(converting & self.adc_done),
            self.sample_valid.eq(held),
            self.sample_code.eq(code),
            self.sample_first.eq(first),
            self.frame_overrun.eq(overrun),
        ]
        wakes = [self.frame_start, overrun, taken, self.adc_start, scanning & (settling != 0), held & self.sample_ready]
        m.d.comb += self.awake.eq(Cat(wakes).any())
        if "sample_last" in self.signature.members:
            m.d.comb += self.sample_last.eq(last)
        m.d.sync += overrun.eq(self.frame_start & scanning)

        with m.If(taken):
            m.d.sync += [held.eq(1), code.eq(self.adc_code), first.eq(row[0] & column[0]), last.eq(frame_ends)]
        with m.Elif(self.sample_ready):
            m.d.sync += held.eq(0)

        with m.If(~scanning), m.If(self.frame_start):
            m.d.sync += [scanning.eq(1), row.eq(1), column.eq(1), settling.eq(self.config.settle_clocks)]
            m.d.sync += Cat(started, resting).eq(0b10)
        with m.Elif(taken):
            m.d.sync += [
                Cat(started, resting).eq(0b10),
                settling.eq(self.config.settle_clocks),
                scanning.eq(~frame_ends),
                column.eq(Cat(row_ends & ~frame_ends, column[:-1])),
            ]
            with m.If(row_ends):
                m.d.sync += row.eq(Cat(Const(0, 1), row[:-1]))
        with m.Elif(self.adc_start):
            m.d.sync += Cat(started, resting).eq(0b01)
        with m.Elif(settling != 0):
            m.d.sync += settling.eq((settling - 1)[: len(settling)])
        return m


class FramePacker(Block[FrameConfig]):
    """Packer of N-bit codes into words without gaps; every frame starts a new word.

    Codes begin only at multiples of the greatest common divisor of N and the word length. So the size of the shifter
    depends on the number of these positions, not on the number of bits.

    Latency: a code at clock t that fills a word, ``word_valid`` at t + 1; a last word that is not full, one clock
    later. Throughput: one code per clock.

    Attributes
    ----------
    sample_valid, sample_ready, sample_code, sample_first, sample_last
        The stream of codes.
    word_valid, word_ready, word_data, word_sync : Out(1), In(1), Out(word_bits), Out(1)
        The stream of words; valid and payload are flops. ``word_sync`` marks the first word of a frame.
    awake : Out(1)
        Low in a clock at whose end no register of the packer changes: its clock may be stopped.
    """

    module_name = "eskin_frame_packer"

    def __init__(self, config: FrameConfig) -> None:
        self.grain = bit_positions(config)
        super().__init__(config, {**sample_ports(config, In), **word_ports(config), "awake": Out(1)})

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        units, step = self.config.word_bits // self.grain, self.config.resolution // self.grain
        valid = Signal()
        word = Signal(self.config.word_bits)
        sync = Signal()
        opening = Signal()
        flush = Signal()
        free = Signal()
        begins = Signal()
        m.d.comb += [
            self.word_valid.eq(valid),
            self.word_data.eq(word),
            self.word_sync.eq(sync),
            free.eq(~valid | self.word_ready),
            self.sample_ready.eq(free & ~flush),
            self.awake.eq((valid & self.word_ready) | (free & (flush | self.sample_valid))),
            begins.eq(opening | (self.sample_first & ~flush)),
        ]
        with m.If(free):
            m.d.sync += valid.eq(0)
        if units == 1:  # a code is a word
            with m.If(free & self.sample_valid):
                m.d.sync += [valid.eq(1), word.eq(self.sample_code), sync.eq(begins)]
            return m

        # In units of the grain: a code is placed at ``fill``; bits beyond the word stay for the next word.
        rest = Signal(self.config.word_bits - self.grain)
        fill = Signal(range(units))
        placed = Signal(self.config.word_bits + self.config.resolution - self.grain)
        after = Signal(range(units + step))
        complete = Signal()
        remains = Signal(range(units))
        m.d.comb += [
            placed.eq(or_tree([rest, *(self._place(fill, position) for position in range(units))])),
            after.eq(fill + step),
            complete.eq(after >= units),
            remains.eq(Mux(complete, after - units, after)[: len(remains)]),
        ]
        emits = Signal()
        m.d.comb += emits.eq(free & (flush | (self.sample_valid & complete)))
        with m.If(emits):
            m.d.sync += [valid.eq(1), word.eq(Mux(flush, rest, placed[: self.config.word_bits])), sync.eq(begins)]
        with m.If(free & flush):
            m.d.sync += [rest.eq(0), fill.eq(0), flush.eq(0), opening.eq(0)]
        with m.Elif(free & self.sample_valid):
            m.d.sync += [
                fill.eq(remains),
                flush.eq(self.sample_last & (remains != 0)),
                opening.eq(begins & ~complete),
                rest.eq(Mux(complete, placed[self.config.word_bits :], placed[: len(rest)])),
            ]
        return m

    def _place(self, fill: Signal, position: int) -> Any:
        """Return the code shifted to a position if ``fill`` equals the position, else 0."""
        chosen = (fill == position).replicate(self.config.resolution)
        return Cat(Const(0, position * self.grain), self.sample_code & chosen)


class FrameReadout(Block[FrameConfig]):
    """Top module of the frame-based baseline: sequencer and packer, without the ADC macro.

    Attributes
    ----------
    frame_start, row_select, column_select, adc_start, adc_done, adc_code, frame_overrun
        See ``FrameSequencer``.
    word_valid, word_ready, word_data, word_sync
        See ``FramePacker``.
    """

    module_name = "eskin_frame_readout"

    def __init__(self, config: FrameConfig) -> None:
        sequencer = FrameSequencer(config)
        inner = {*sample_ports(config, Out), "awake"}
        ports = {name: port for name, port in sequencer.signature.members.items() if name not in inner}
        super().__init__(config, {**ports, **word_ports(config)})

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        sequencer, packer = FrameSequencer(self.config), FramePacker(self.config)
        sequencer.place(m, "sequencer", platform)
        packer.place(m, "packer", platform)
        sequencer.connect_all(m, packer, sample_ports(self.config, Out))
        for name in self.signature.members:
            block = packer if name.startswith("word_") else sequencer
            block.connect(m, name, getattr(self, name))
        # No logic in this block uses the signal; a clock gate may.
        awake = Signal(attrs={"keep": 1})
        m.d.comb += awake.eq(sequencer.awake | packer.awake)
        return m


def sample_ports(config: FrameConfig, flow: Any) -> dict[str, Any]:
    """Return the ports of a stream of codes; ``flow`` is Out at the source and In at the sink."""
    back = In if flow is Out else Out
    ports = {
        "sample_valid": flow(1),
        "sample_ready": back(1),
        "sample_code": flow(config.resolution),
        "sample_first": flow(1),
    }
    if config.word_bits > config.resolution:  # else a frame always ends with a full word
        ports["sample_last"] = flow(1)
    return ports


def word_ports(config: FrameConfig) -> dict[str, Any]:
    """Return the ports of the output word stream."""
    return {"word_valid": Out(1), "word_ready": In(1), "word_data": Out(config.word_bits), "word_sync": Out(1)}


def converter(config: FrameConfig) -> str:
    """Return the ADC of the delivered testbench."""
    return f"""\
  // The ADC samples the selected taxel at the edge that ends adc_start. Its code is wrong before
  // adc_done.
  reg [{config.resolution - 1}:0] code;
  integer remaining = 0;
  integer taxel;
  always @(posedge clk) begin
    if (running && adc_start) begin
      code = 0;
      for (taxel = 0; taxel < {config.taxels}; taxel = taxel + 1)
        if (row_select[taxel/{config.columns}] && column_select[taxel%{config.columns}])
          code = code | sample[taxel*{config.resolution}+:{config.resolution}];
      remaining = {config.adc_clocks};
    end else if (remaining != 0) remaining = remaining - 1;
    adc_done <= remaining == 1;
    adc_code <= remaining == 1 ? code : ~code;
  end
"""


RECEIVER = f"""\
  // The sink is not ready in one of {len(READY)} clocks.
  always @(posedge clk) begin
    word_ready <= !running || (clock + 1) % {len(READY)} != {READY.index(0)};
    if (running && word_valid && word_ready) check(clock, {{word_sync, word_data}});
    if (running && frame_overrun) fail("a frame_start is not heard");
  end
"""
"""Sink of the delivered testbench."""
