"""Compare the register file's RTL with its model in every clock: registers, unused addresses, counters."""

from __future__ import annotations

from typing import Any

import cocotb

from eskin.cocotb_tests.bench.block import begin, report
from eskin.cocotb_tests.bench.spi import any_word
from eskin.model.registers.description import registers
from eskin.model.registers.file import RegisterFile, Write

CLOCKS = 1500


@cocotb.test()
async def file_follows_its_model(dut: Any) -> None:
    """Write words in and out of range to every address, with random counter inputs."""
    config, rng, block, check = begin(dut)
    file = RegisterFile(config)
    found = registers(config)
    counters = [r.signal(f) for r in found for f in r.fields if f.kind == "counter"]
    announced = [r.signal(f) for r in found for f in r.fields if f.announced]
    block.drive(address=0, write=0, write_data=0, clear=0, **{f"{name}_counts": 0 for name in counters})
    await block.reset()
    for _ in range(CLOCKS):
        register = rng.choice(found)
        address = register.address if rng.random() < 0.9 else rng.choice([rng.randrange(1 << 15), register.address + 1])
        word = any_word(rng)
        if rng.random() < 0.5:  # every field in its range
            word = sum(rng.randint(f.least, f.most) << f.low for f in register.fields)
        write, clear, rst = rng.random() < 0.4, rng.random() < 0.01, rng.random() < 0.003
        counted = {name for name in counters if rng.random() < 0.3}
        block.drive(address=address, write=write, write_data=word, clear=clear, rst=rst)
        block.drive(**{f"{name}_counts": name in counted for name in counters})
        await block.settle()
        if rst and config.reset == "async":
            file.reset()
        check.equal("read_data", file.read(address), block.read("read_data"), (hex(address), vars(file)["words"]))
        for name, value in file.signals().items():
            check.equal(name, value, block.read(name))
        for name in announced:
            check.equal(f"{name}_written", name in file.written, block.read(f"{name}_written"))
        check.counts["holes"] += address not in file.at
        check.counts["refused"] += write and address == register.address and not register.allows(word)
        check.counts["taken"] += write and address == register.address and register.allows(word)
        check.counts[f"counted {max(file.read(r.address) for r in found if r.name == 'events') > 10}"] += 1
        await block.edge()
        file.clock(Write(address, word) if write else None, counted, clear)
        if rst:
            file.reset()
    report(check.counts)
