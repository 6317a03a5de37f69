"""Steps of the register file: words in and out of range to every address, and random counter inputs."""

import random
from collections import Counter
from collections.abc import Iterator

from eskin.cocotb_tests.bench.block import Step
from eskin.cocotb_tests.bench.spi import any_word
from eskin.model.config import ReadoutConfig
from eskin.model.registers.description import registers
from eskin.model.registers.file import RegisterFile, Write

CLOCKS = 1500


def steps(config: ReadoutConfig, rng: random.Random, counts: Counter[str]) -> Iterator[Step]:
    """Yield the inputs of the register file, and the outputs of its model."""
    file = RegisterFile(config)
    found = registers(config)
    counters = [r.signal(f) for r in found for f in r.fields if f.kind == "counter"]
    announced = [r.signal(f) for r in found for f in r.fields if f.announced]
    for _ in range(CLOCKS):
        register = rng.choice(found)
        address = register.address if rng.random() < 0.9 else rng.choice([rng.randrange(1 << 15), register.address + 1])
        word = any_word(rng)
        if rng.random() < 0.5:  # every field in its range
            word = sum(rng.randint(f.least, f.most) << f.low for f in register.fields)
        write, clear, rst = rng.random() < 0.4, rng.random() < 0.01, rng.random() < 0.003
        counted = {name for name in counters if rng.random() < 0.3}
        if rst and config.reset == "async":
            file.reset()
        inputs = {"address": address, "write": write, "write_data": word, "clear": clear, "rst": rst}
        outputs = {"read_data": file.read(address), **file.signals()}
        outputs |= {f"{name}_written": name in file.written for name in announced}
        yield Step(inputs | {f"{name}_counts": name in counted for name in counters}, outputs, str(file.words))
        counts["holes"] += address not in file.at
        counts["refused"] += write and address == register.address and not register.allows(word)
        counts["taken"] += write and address == register.address and register.allows(word)
        counts[f"counted {max(file.read(r.address) for r in found if r.name == 'events') > 10}"] += 1
        file.clock(Write(address, word) if write else None, counted, clear)
        if rst:
            file.reset()
