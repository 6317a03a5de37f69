"""Top level of a board: serial line, frames, and the chip or an AER receiver."""

from typing import Any

from amaranth.back import rtlil
from amaranth.hdl import Cat, Const, EnableInserter, Module, ResetInserter, Signal
from amaranth.lib.wiring import Component, In, Out

from eskin.board.config import ADDRESS_BITS, BoardConfig
from eskin.board.gateware.aer import AerReceiver
from eskin.board.gateware.loader import Loader
from eskin.board.gateware.recorder import CLOCK_BITS, RESERVE, Recorder
from eskin.board.gateware.sensor import Scanner
from eskin.board.gateware.serial_frames import FrameReceiver, FrameSender
from eskin.board.gateware.uart import UartReceiver, UartSender
from eskin.board.records import STATUS_WORDS, VALUE_BITS, WORD_BITS, Reason
from eskin.rtl import yosys
from eskin.rtl.classifier.chip import Chip

TOP = "eskin_board"
SKIN_PINS = ("rows", "sclk", "cs_n", "mosi", "miso")


def _pins(config: BoardConfig) -> dict[str, Any]:
    """Return the pins beside the serial line: for an AER receiver, or for a skin and its converter."""
    if config.sensor and config.chip:
        members = Scanner(config.sensor, config.chip.readout, config.serial.clock_hz).signature.members
        return {name: members[name] for name in SKIN_PINS}
    if config.chip:
        return {}
    return {"aer_req": In(1), "aer_req_off": In(1), "aer_ack": Out(1), "aer_addr": In(ADDRESS_BITS)}


class Core(Component):
    """All logic that a new session resets: frames from the host, recorder, and records to the host."""

    def __init__(self, config: BoardConfig) -> None:
        self.config = config
        received = FrameReceiver(config.serial).signature.members
        names = ("taken", "refused", "refused_sequence", "refused_expected", "refused_reason")
        super().__init__(
            {
                "valid": In(1),
                "ready": Out(1),
                "data": In(8),  # bytes of good frames
                **{name: In(received[name].shape) for name in names},
                "byte_valid": Out(1),  # to the line
                "byte_ready": In(1),
                "byte": Out(8),
                **_pins(config),
            }
        )

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        m.submodules.loader = loader = Loader(self.config)
        m.submodules.recorder = recorder = Recorder(self.config)
        m.submodules.sender = sender = FrameSender(self.config.serial)
        now, greeted = Signal(CLOCK_BITS), Signal()
        refused_valid, refused_word = Signal(), Signal(VALUE_BITS)
        self._join(m, loader, recorder, sender)
        m.d.comb += [
            recorder.hello_valid.eq(~greeted),  # the board describes itself after each reset
            recorder.refused_valid.eq(refused_valid),
            recorder.refused_word.eq(refused_word),
            loader.unknown_ready.eq(~refused_valid),
        ]
        with m.If(recorder.hello_ready):
            m.d.sync += greeted.eq(1)
        # One refusal waits here: later refusals are its consequence, and are only counted.
        with m.If(self.refused & ~refused_valid):
            word = Cat(self.refused_sequence, self.refused_expected, self.refused_reason)
            m.d.sync += [refused_valid.eq(1), refused_word.eq(word)]
        with m.Elif(loader.unknown_valid & ~refused_valid):
            word = Cat(loader.ack_sequence, loader.ack_sequence, Const(Reason.UNKNOWN, 4))
            m.d.sync += [refused_valid.eq(1), refused_word.eq(word)]
        with m.Elif(recorder.refused_ready):
            m.d.sync += refused_valid.eq(0)

        bins, stalls, lost = self._chip(m, loader, recorder, now) if self.config.chip else self._aer(m, recorder, now)
        with m.If(loader.restart):
            m.d.sync += now.eq(0)
        counted = {
            "events": recorder.event_valid & recorder.idle,
            "bins": bins,
            "taken": self.taken,
            "refused": self.refused | (loader.unknown_valid & loader.unknown_ready),
            "lost": lost,
        }
        values: dict[str, Any] = {"time_low": now[:WORD_BITS], "time_high": now[WORD_BITS:], "stalls": stalls}
        for name, happens in counted.items():
            values[name] = count = Signal(VALUE_BITS, name=f"{name}_count")
            with m.If(happens & ~count.all()):
                m.d.sync += count.eq(count + 1)
        words = [Cat(values[name], Const(0, WORD_BITS))[:WORD_BITS] for name in STATUS_WORDS]
        m.d.comb += recorder.status_words.eq(Cat(words))
        return m

    def _join(self, m: Module, loader: Loader, recorder: Recorder, sender: FrameSender) -> None:
        """Connect loader, recorder and sender with each other and with the ports."""
        m.d.comb += [
            loader.valid.eq(self.valid),
            loader.data.eq(self.data),
            self.ready.eq(loader.ready),
            recorder.ack_valid.eq(loader.ack_valid),
            recorder.ack_sequence.eq(loader.ack_sequence),
            loader.ack_ready.eq(recorder.ack_ready),
            recorder.status_valid.eq(loader.status_valid),
            loader.status_ready.eq(recorder.status_ready),
            sender.level.eq(recorder.level),
            sender.word.eq(recorder.word),
            recorder.take.eq(sender.take),
            self.byte_valid.eq(sender.valid),
            self.byte.eq(sender.byte),
            sender.ready.eq(self.byte_ready),
        ]

    def _chip(self, m: Module, loader: Loader, recorder: Recorder, now: Signal) -> tuple[Any, Any, Any]:
        """Add the chip; its clock stops while the chip waits for samples or while the recorder writes."""
        assert self.config.chip is not None
        chip = Chip(self.config.chip)
        run = Signal()
        clocked = Signal()
        m.d.comb += [run.eq(loader.active & recorder.idle), loader.run.eq(run), clocked.eq(run | loader.restart)]
        m.submodules.chip = ResetInserter(loader.restart)(EnableInserter(clocked)(chip))
        with m.If(run):
            m.d.sync += now.eq(now + 1)
        m.d.comb += [
            chip.taxel_enable.eq((1 << self.config.chip.readout.taxels) - 1),
            chip.sample.eq(loader.sample),
            chip.sample_valid.eq(loader.sample_valid),
            recorder.short.eq(loader.short),
            recorder.restart.eq(loader.restart),
            recorder.rests.eq(~loader.active & (recorder.level == 0)),
            *(getattr(chip, n).eq(getattr(loader, n)) for n in loader.signature.members if n.startswith("load_")),
            recorder.event_valid.eq(chip.event_valid & chip.event_ready & run),
            recorder.event_address.eq(chip.event_channel if self.config.chip.classifier.channel_bits else 0),
            recorder.event_time.eq(now),
            recorder.class_valid.eq(chip.class_valid & run),
            recorder.class_index.eq(chip.class_index),
            recorder.class_overrun.eq(chip.overrun),
            recorder.class_sure.eq(chip.class_sure if self.config.chip.classifier.margin else 0),
            recorder.evidence.eq(chip.evidence),
        ]
        late: Any = self._skin(m, loader) if self.config.sensor else Const(0, 1)
        return recorder.class_valid, chip.stall_count, late

    def _skin(self, m: Module, loader: Loader) -> Signal:
        """Add the scanner of a skin, and return the signal that reports a late scan.

        The tick of a late scan is lost.
        """
        assert self.config.chip is not None
        assert self.config.sensor is not None
        scanner = Scanner(self.config.sensor, self.config.chip.readout, self.config.serial.clock_hz)
        m.submodules.scanner = scanner
        m.d.comb += [
            scanner.allowed.eq(loader.sensing),
            scanner.restart.eq(loader.restart),
            loader.taxel_valid.eq(scanner.valid),
            loader.taxel.eq(scanner.sample),
            scanner.miso.eq(self.miso),
            *(getattr(self, name).eq(getattr(scanner, name)) for name in SKIN_PINS if name != "miso"),
        ]
        return scanner.late

    def _aer(self, m: Module, recorder: Recorder, now: Signal) -> tuple[Any, Any, Any]:
        """Add the AER receiver, which drops and counts events while the FIFO is full."""
        m.submodules.aer = aer = AerReceiver()
        m.d.sync += now.eq(now + 1)
        m.d.comb += [
            aer.aer_req.eq(self.aer_req),
            aer.aer_req_off.eq(self.aer_req_off),
            aer.aer_addr.eq(self.aer_addr),
            self.aer_ack.eq(aer.aer_ack),
            aer.now.eq(now),
            aer.full.eq(recorder.level > self.config.serial.records - RESERVE),
            aer.ready.eq(recorder.idle),
            recorder.event_valid.eq(aer.valid),
            recorder.event_address.eq(aer.address),
            recorder.event_time.eq(aer.time),
            recorder.lost.eq(aer.lost),
            aer.lost_told.eq(recorder.lost_told),
        ]
        return Const(0, 1), Const(0, 1), aer.lost_now


class Board(Component):
    """Top module; a valid HELLO frame of the host starts a session and resets everything except the serial line.

    Beside the serial line ``rx`` and ``tx``, a player with a skin has the pins of ``Scanner``, and a receiver has those
    of ``AerReceiver``.
    """

    def __init__(self, config: BoardConfig) -> None:
        self.config = config
        super().__init__({"rx": In(1, init=1), "tx": Out(1, init=1), **_pins(config)})

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        serial = self.config.serial
        m.submodules.uart_receiver = uart_receiver = UartReceiver(serial)
        m.submodules.uart_sender = uart_sender = UartSender(serial)
        m.submodules.frames = frames = FrameReceiver(serial)
        core = Core(self.config)
        m.submodules.core = ResetInserter(frames.session)(core)
        shared = ("taken", "refused", "refused_sequence", "refused_expected", "refused_reason", "valid", "data")
        m.d.comb += [
            uart_receiver.line.eq(self.rx),
            self.tx.eq(uart_sender.line),
            frames.byte_valid.eq(uart_receiver.valid),
            frames.byte.eq(uart_receiver.data),
            *(getattr(core, name).eq(getattr(frames, name)) for name in shared),
            frames.ready.eq(core.ready),
            uart_sender.valid.eq(core.byte_valid),
            uart_sender.data.eq(core.byte),
            core.byte_ready.eq(uart_sender.ready),
        ]
        for name, member in _pins(self.config).items():
            inner, outer = getattr(core, name), getattr(self, name)
            m.d.comb += inner.eq(outer) if member.flow is In else outer.eq(inner)
        return m


def netlist(config: BoardConfig) -> str:
    """Return the design of a board as RTLIL."""
    return str(rtlil.convert(Board(config), name=TOP, emit_src=False))


def verilog(config: BoardConfig) -> str:
    """Return the design of a board as Verilog with initial values, for simulation."""
    script = f"read_rtlil readout.il; hierarchy -check -top {TOP}; proc; opt_clean; write_verilog -noattr readout.v"
    return yosys.run(script, netlist(config), "readout.v")
