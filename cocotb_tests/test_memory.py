"""Compare the weight memories with a list, including one clock of latency and reads during writes."""

from __future__ import annotations

import json
import os
import random
from pathlib import Path
from typing import Any

import cocotb
import pytest

from eskin.cocotb_tests.bench.block import JOB, Block, Checker, report
from eskin.cocotb_tests.runner.block import cosimulate
from eskin.cocotb_tests.test_classifier import network_of
from eskin.rtl.classifier.memory import address_bits

CLOCKS = 400
CONFIG = network_of(5, 12, 3, 4)
TOPS = {
    "eskin_input_weights": CONFIG.input_words,
    "eskin_recurrent_weights": CONFIG.recurrent_words,
    "eskin_neuron_weights": CONFIG.neuron_words,
}


@cocotb.test()
async def memory_is_a_list(dut: Any) -> None:
    """Fill the memory, then read and write at random addresses."""
    job = json.loads(os.environ[JOB])
    rng, words = random.Random(job["seed"]), job["words"]
    block = Block(dut)
    check = Checker(block)
    content = [rng.getrandbits(len(block.pin("write_data"))) for _ in range(words)]
    for address, word in enumerate(content):
        block.drive(read_valid=0, write_valid=1, write_address=address, write_data=word)
        await block.edge()
    read = None
    for _ in range(CLOCKS):
        writes, reads, at, to = rng.random() < 0.4, rng.random() < 0.7, rng.randrange(words), rng.randrange(words)
        at = to if rng.random() < 0.3 else at
        word = rng.getrandbits(len(block.pin("write_data")))
        block.drive(read_valid=reads, read_address=at, write_valid=writes, write_address=to, write_data=word)
        await block.settle()
        if read is not None:
            check.equal("read_data", read, block.read("read_data"), f"read {at}, write {to if writes else 'nothing'}")
        check.counts["at one address"] += writes and at == to
        await block.edge()
        if writes:
            content[to] = word
        elif reads:
            read = content[at]
    report(check.counts)


def test_an_address_has_as_many_bits_as_the_last_word_needs() -> None:
    assert [address_bits(words) for words in (1, 2, 3, 4, 5, 8, 9, 64, 65)] == [1, 1, 2, 2, 3, 3, 4, 6, 7]


@pytest.mark.parametrize("top", TOPS)
def test_memory_reads_what_was_written_when_it_is_told_and_nothing_during_a_write(top: str, tmp_path: Path) -> None:
    module = "eskin.cocotb_tests.test_memory"
    counts = cosimulate(CONFIG, "icarus", top, "memory_is_a_list", tmp_path, 4, module, words=TOPS[top])
    assert counts["checks"] > CLOCKS / 2
    assert counts["at one address"] > 20
