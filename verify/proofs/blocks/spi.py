"""Properties of the SPI slave and of the AXI4-Lite host in front of it: accesses are exact and complete."""

from typing import Any, ClassVar, cast

from amaranth.hdl import Cat, Const, Module, Mux, Signal, Value

from eskin.model.config import ReadoutConfig
from eskin.model.registers.description import WORD_BYTES
from eskin.model.registers.spi import GAP_CLOCKS, HIGH_CLOCKS, LAG_CLOCKS, LEAD_CLOCKS, LOW_CLOCKS_TO_READ
from eskin.rtl.bus.axi_lite import NarrowLite
from eskin.rtl.registers.spi import NarrowSlave, SpiSlave
from eskin.verify.proofs.checker import Checker, Promises, before, implies


class Transfers:
    """SPI transfers, decoded from the pins.

    ``complete`` is high with the last bit of a word of a write transfer, whose ``address`` and ``word`` are then valid.
    ``in_data`` is high once the command is complete, and ``reads`` if the command reads.
    """

    def __init__(self, m: Module, pins: Any, slave: type[SpiSlave]) -> None:
        address_bits, self.word_bits = slave.address_bits, slave.word_bits
        command_bits, whole_bits = 1 + address_bits, 1 + address_bits + self.word_bits
        sck = _past(m, pins.spi_sck, "sck", 3)
        cs_n = _past(m, pins.spi_cs_n, "cs_n", 4)
        mosi = _past(m, pins.spi_mosi, "mosi", 2)
        self.under_way, self.closed = Signal(name="under_way"), cs_n[1]
        opens = ~cs_n[1] & cs_n[2] & cs_n[3]
        m.d.sync += self.under_way.eq(opens | (self.under_way & ~cs_n[1]))
        unbroken = self.under_way & ~cs_n[1]
        self.rise, self.fall = unbroken & sck[1] & ~sck[2], unbroken & ~sck[1] & sck[2]

        # Bits of the command and the word so far, and all that was sent, taken with every rise.
        bits, sent, writes = Signal(range(whole_bits)), Signal(max(self.word_bits, command_bits)), Signal()
        whole, now = bits == whole_bits - 1, Cat(mosi[1], sent[:-1])
        with m.If(opens):
            m.d.sync += bits.eq(0)
        with m.Elif(self.rise):
            m.d.sync += [bits.eq(Mux(whole, command_bits, bits + 1)), sent.eq(now)]
        self.address = Signal(address_bits, name="address_sent")
        with m.If(self.rise & (bits == command_bits - 1)):
            m.d.sync += [self.address.eq(now), writes.eq(now[address_bits])]
        with m.Elif(self.rise & whole):
            m.d.sync += self.address.eq(self.address + WORD_BYTES)
        self.complete, self.word = self.rise & whole & writes, now[: self.word_bits]
        self.in_data, self.first = bits >= command_bits, bits == command_bits
        self.reads = self.in_data & ~writes

    def shown(self, m: Module, word: Value) -> Value:
        """Return the bit of a word that MISO must show; the slave copies the word before its first bit."""
        kept, moves = Signal(self.word_bits, name="kept"), self.fall & self.reads
        return Checker.keep(m, kept, moves & self.first, moves, Cat(Const(0, 1), kept[:-1]), start=word)[-1]


def _past(m: Module, pin: Value, name: str, clocks: int) -> list[Signal]:
    """Return the values of a pin one clock ago, two clocks ago, and so on."""
    found: list[Any] = []
    for clock in range(clocks):
        found.append(before(m, found[-1] if found else pin, f"{name}_{clock}"))
    return found


class SpiChecker(Checker[ReadoutConfig]):
    """Checker of the SPI slave; pins and data are free."""

    block: ClassVar[type[SpiSlave]] = SpiSlave

    def check(self, m: Module) -> Promises:
        sent = Transfers(m, self, self.block)
        complete = sent.complete
        yield "aborted_writes_nothing", implies(self.write, complete), self.write
        yield "whole_is_written", implies(complete, self.write), complete
        yield "written_as_sent", implies(self.write, self.write_data == sent.word), self.write & sent.word[0]
        same = implies(sent.in_data, self.address == sent.address)
        yield "address_as_sent", same, self.write & (sent.address != 0)
        kept = sent.shown(m, self.read_data)
        yield "read_as_kept", implies(sent.reads & sent.rise, self.spi_miso == kept), sent.reads & kept
        yield "quiet_otherwise", implies(~sent.reads, ~self.spi_miso), ~sent.reads & sent.rise
        closes = sent.under_way & sent.closed
        yield "opens_after_two", self.spi_miso_enable == sent.under_way, closes


class NarrowSpiChecker(SpiChecker):
    """Checker of the SPI slave with short addresses and words."""

    block = NarrowSlave


class AxiLiteChecker(Checker[ReadoutConfig]):
    """Checker of the AXI4-Lite host with short addresses and words; the manager and MISO are free."""

    block = NarrowLite
    assumptions: ClassVar = {"manager_waits": "a manager holds a valid signal and its payload until ready"}

    def check(self, m: Module) -> Promises:
        channels = [("aw", Cat(self.s_axi_awaddr)), ("w", Cat(self.s_axi_wdata, self.s_axi_wstrb))]
        channels.append(("ar", Cat(self.s_axi_araddr)))
        holds = Const(1)
        for name, payload in channels:
            valid, ready = getattr(self, f"s_axi_{name}valid"), getattr(self, f"s_axi_{name}ready")
            holds &= self.unchanged(m, valid, ready, payload)[0]
        kept = Signal(init=1)
        m.d.sync += kept.eq(kept & holds)
        self.suppose(m, "manager_waits", holds)
        kept = kept & holds

        writes = self.s_axi_awvalid & self.s_axi_awready
        reads = self.s_axi_arvalid & self.s_axi_arready
        whole = self.s_axi_wstrb.all()
        together = (self.s_axi_awready == self.s_axi_wready) & ~(self.s_axi_awready & self.s_axi_arready)
        together &= implies(self.s_axi_awready, self.s_axi_awvalid & self.s_axi_wvalid)
        yield "one_access", implies(kept, together & implies(self.s_axi_arready, self.s_axi_arvalid)), writes
        ended = {"write": self.s_axi_bvalid & self.s_axi_bready, "read": self.s_axi_rvalid & self.s_axi_rready}
        owed = {}
        for kind, begins in (("write", writes), ("read", reads)):
            owed[kind] = self.keep(m, Signal(name=f"owes_{kind}"), 0, begins | ended[kind], begins)
        waits = owed["write"] | owed["read"]
        answers = implies(self.s_axi_bvalid, owed["write"]) & implies(self.s_axi_rvalid, owed["read"])
        answers &= implies(writes | reads, ~waits)
        yield "one_response", implies(kept, answers), ended["write"]
        wrote = self.unchanged(m, self.s_axi_bvalid, self.s_axi_bready, self.s_axi_bresp)
        read = self.unchanged(m, self.s_axi_rvalid, self.s_axi_rready, Cat(self.s_axi_rdata, self.s_axi_rresp))
        yield "response_waits", wrote[0] & read[0], wrote[1] & self.s_axi_bvalid
        refused = self.keep(m, Signal(name="refused"), 0, writes, ~whole)
        said = implies(self.s_axi_bvalid, self.s_axi_bresp == Mux(refused, 0b10, 0b00)) & (self.s_axi_rresp == 0)
        yield "slverr_without_strobes", implies(kept, said), self.s_axi_bvalid & refused
        turn, due = self.fair(m, writes, self.s_axi_arvalid, reads)
        other, other_due = self.fair(m, reads, self.s_axi_awvalid & self.s_axi_wvalid, writes)
        yield "turns", implies(kept, turn & other), due | other_due
        yield from self._transfer(m, kept, writes, reads, whole)

    def _transfer(self, m: Module, kept: Value, writes: Value, reads: Value, whole: Value) -> Promises:
        """Compare accepted accesses with the transfers on the pins."""
        sent = Transfers(m, self, cast(type[SpiSlave], self.block))
        address, word = Signal(len(sent.address)), Signal(len(sent.word))
        self.keep(m, address, 0, writes | reads, Mux(writes, self.s_axi_awaddr, self.s_axi_araddr) & ~0b11)
        self.keep(m, word, 0, writes, self.s_axi_wdata)
        due = self.keep(m, Signal(name="write_due"), 0, (writes & whole) | sent.complete, writes & whole)
        exact = due & (sent.address == address) & (sent.word == word)
        yield "written_as_asked", implies(kept & sent.complete, exact), sent.complete & (address != 0)
        effective = implies(self.s_axi_bvalid & ~self.s_axi_bresp.any(), ~due)
        yield "written_before_response", implies(kept, effective), self.s_axi_bvalid & ~self.s_axi_bresp.any()
        begins = sent.rise & sent.first & sent.reads  # the first bit of the word
        found = self.keep(m, Signal(name="word_begun"), 0, writes | reads | begins, begins)
        asked = implies(begins, sent.address == address) & implies(self.s_axi_rvalid, found)
        yield "read_where_asked", implies(kept, asked), self.s_axi_rvalid & (address != 0)
        falls = before(m, self.spi_sck, "sck_now") & ~self.spi_sck
        shown, last = (Signal(len(word), name=name) for name in ("shown", "last_shown"))
        m.d.comb += last.eq(Mux(falls, Cat(before(m, self.spi_miso, "miso"), shown[:-1]), shown))
        m.d.sync += shown.eq(last)
        yield "read_as_shown", implies(self.s_axi_rvalid, self.s_axi_rdata == last), self.s_axi_rvalid & last.any()
        yield "spi_in_time", *self._times(m)

    def _times(self, m: Module) -> tuple[Value, Value]:
        """Return whether the pins keep the times of the SPI slave, and whether a transfer ends."""
        sck, cs_n = self.spi_sck, self.spi_cs_n
        most = max(HIGH_CLOCKS, LOW_CLOCKS_TO_READ, LEAD_CLOCKS, LAG_CLOCKS, GAP_CLOCKS)
        was, closed = before(m, sck, "sck_was"), before(m, ~cs_n, "open_was")
        clears = {"high": ~sck, "low": sck, "opened": cs_n}
        high, low, since = (self.count_to(m, most, clear, 1, name=name) for name, clear in clears.items())
        shut = self.count_to(m, most, ~cs_n, 1, start=0, name="shut")
        known = Signal()
        m.d.sync += known.eq(known | ~cs_n)
        rises = ~was & sck
        right = implies(was & ~sck, high >= HIGH_CLOCKS) & implies(rises, since >= LEAD_CLOCKS) & implies(cs_n, ~sck)
        right &= implies(rises & (since > LOW_CLOCKS_TO_READ), low >= LOW_CLOCKS_TO_READ)
        right &= implies(closed & cs_n, high >= LAG_CLOCKS) & implies(known & ~closed & ~cs_n, shut >= GAP_CLOCKS)
        return right, closed & cs_n
