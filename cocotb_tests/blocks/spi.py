"""Compare the SPI slave's RTL with its model in every clock, and test it with an asynchronous host."""

import itertools
import random
from collections import Counter
from collections.abc import Iterator
from typing import Any

import cocotb
from cocotb.triggers import Timer

from eskin.cocotb_tests.bench.block import Block, Step, begin, report
from eskin.cocotb_tests.bench.spi import any_word, next_address, traffic
from eskin.model.config import ReadoutConfig
from eskin.model.registers.description import WORD_BITS
from eskin.model.registers.spi import HIGH_CLOCKS, LEAD_CLOCKS, LOW_CLOCKS, LOW_CLOCKS_TO_READ, Pins, SpiSlave, transfer

CLOCKS = 6_000


def steps(config: ReadoutConfig, rng: random.Random, counts: Counter[str]) -> Iterator[Step]:
    """Yield complete and aborted transfers, glitches on CS, random edges, and resets."""
    slave = SpiSlave()
    for pins in itertools.islice(traffic([0, 4, 64, 32764], [any_word(rng) for _ in range(20)], rng), CLOCKS):
        word, rst = rng.getrandbits(WORD_BITS), rng.random() < 0.0005
        if rst and config.reset == "async":
            slave.reset()
        write = slave.write is not None
        outputs = {"write": write, "write_data": slave.received, "address": slave.address}
        outputs |= {"spi_miso": slave.miso, "spi_miso_enable": slave.active}
        yield Step(pins_of(pins) | {"read_data": word, "rst": rst}, outputs, str(vars(slave)))
        counts["writes"] += write
        counts["ones read"] += slave.miso
        counts["broken off"] += slave.active and slave.cs_n[1] == 1 and slave.count > 0
        counts["locked out"] += not slave.active and slave.cs_n[1] == 0 and slave.sck[1:] == [1, 0]
        counts["resets"] += rst
        slave.clock(pins, word)
        if rst:
            slave.reset()


def pins_of(pins: Pins) -> dict[str, int]:
    """Return the levels of the SPI pins by port name."""
    return {"spi_sck": pins.sck, "spi_cs_n": pins.cs_n, "spi_mosi": pins.mosi}


class Host:
    """SPI host that is asynchronous to the readout's clock."""

    def __init__(self, block: Block, period_ps: int, rng: random.Random) -> None:
        self.block, self.period_ps, self.rng = block, period_ps, rng

    async def wait(self, clocks: float) -> None:
        """Wait for a number of clocks of the readout, plus a random fraction."""
        await Timer(round(clocks * self.period_ps) + self.rng.randrange(1, self.period_ps), "ps")

    async def transfer(self, address: int, words: list[int], write: bool) -> list[int]:
        """Make a transfer at the highest specified rate; return the words read."""
        pins, found = self.block.dut, 0
        pins.spi_cs_n.value = 0
        await self.wait(LEAD_CLOCKS)
        bits = transfer(address, words, write)
        for bit in bits:
            pins.spi_mosi.value = bit
            await Timer(self.rng.randrange(1, self.period_ps), "ps")
            found = found << 1 | int(str(pins.spi_miso.value), 2)  # read just before SCK rises
            pins.spi_sck.value = 1
            await Timer(HIGH_CLOCKS * self.period_ps + 1, "ps")
            pins.spi_sck.value = 0
            await Timer((LOW_CLOCKS if write else LOW_CLOCKS_TO_READ) * self.period_ps, "ps")
        await self.wait(LEAD_CLOCKS)
        pins.spi_cs_n.value = 1
        await self.wait(3)
        return [found >> WORD_BITS * place & (1 << WORD_BITS) - 1 for place in reversed(range(len(words)))]


@cocotb.test()
async def host_of_another_clock_reads_what_it_wrote(dut: Any) -> None:
    """Write and read random words of a memory behind the slave, and compare them."""
    _, rng, block, check = begin(dut)
    block.drive(read_data=0, **pins_of(Pins()))
    await block.reset()
    memory: dict[int, int] = {}

    async def clock() -> None:
        while True:
            block.drive(read_data=memory.get(block.read("address"), 0xDEAD))
            await block.settle()
            if block.read("write"):
                memory[block.read("address")] = block.read("write_data")
            await block.edge()

    cocotb.start_soon(clock())
    host = Host(block, 2 * Block.HALF_PS, rng)
    await host.wait(5)
    expected: dict[int, int] = {}
    for _ in range(30):
        address, words = rng.choice([0, 8, 256, 0x7FF8]), [any_word(rng) for _ in range(rng.randint(1, 3))]
        places = [address]
        while len(places) < len(words):
            places.append(next_address(places[-1]))
        if rng.random() < 0.5:
            await host.transfer(address, words, write=True)
            expected |= dict(zip(places, words, strict=True))
            check.holds("WrittenAsSent", memory == expected, (memory, expected))
        else:
            found = await host.transfer(address, words, write=False)
            check.holds("ReadAsKept", found == [memory.get(place, 0xDEAD) for place in places], found)
    report(check.counts)
