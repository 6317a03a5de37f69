"""Compare the weight memories with a list, including one clock of latency and reads during writes."""

import random
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from eskin.cocotb_tests.bench.block import Step
from eskin.cocotb_tests.runner.block import play_steps
from eskin.cocotb_tests.test_classifier import network_of
from eskin.model.classifier.config import ClassifierConfig
from eskin.rtl.classifier.memory import address_bits

CLOCKS = 400
CONFIG = network_of(5, 12, 3, 4, own_parameters=True)
DEEP = network_of(1, 60, 1, 1, layers=((0, 40, (0,)), (40, 60, (0, 1))))
MEMORIES = {
    "eskin_input_weights": (CONFIG, CONFIG.input_words),
    "eskin_recurrent_weights": (CONFIG, CONFIG.recurrent_words),
    "eskin_neuron_weights": (CONFIG, CONFIG.neuron_words),
    "eskin_neuron_parameters": (CONFIG, CONFIG.parameter_words),
    "eskin_recurrent_weights of two arrays": (DEEP, DEEP.recurrent_words),
}


def steps(words: int, rng: random.Random, counts: Counter[str]) -> Iterator[Step]:
    """Yield the writes that fill the memory, then reads and writes at random addresses."""
    content = [rng.getrandbits(256) for _ in range(words)]  # the bench cuts them to the bits of a word
    for address, word in enumerate(content):
        yield Step({"read_valid": 0, "write_valid": 1, "write_address": address, "write_data": word}, {})
    read = None
    for _ in range(CLOCKS):
        writes, reads, at, to = rng.random() < 0.4, rng.random() < 0.7, rng.randrange(words), rng.randrange(words)
        at = to if rng.random() < 0.3 else at
        word = rng.getrandbits(256)
        inputs = {"read_valid": reads, "read_address": at, "write_valid": writes, "write_address": to}
        yield Step(inputs | {"write_data": word}, {} if read is None else {"read_data": read})
        counts["at one address"] += writes and at == to
        if writes:
            content[to] = word
        elif reads:
            read = content[at]


def test_an_address_has_as_many_bits_as_the_last_word_needs() -> None:
    assert [address_bits(words) for words in (1, 2, 3, 4, 5, 8, 9, 64, 65)] == [1, 1, 2, 2, 3, 3, 4, 6, 7]


@pytest.mark.parametrize("name", MEMORIES)
def test_memory_reads_what_was_written_when_it_is_told_and_nothing_during_a_write(name: str, tmp_path: Path) -> None:
    config, words = MEMORIES[name]

    def of_words(_: ClassifierConfig, rng: random.Random, counts: Counter[str]) -> Iterator[Step]:
        return steps(words, rng, counts)

    counts = play_steps(config, "icarus", name.split()[0], of_words, tmp_path, seed=4)
    assert counts["checks"] > CLOCKS / 2
    assert counts["at one address"] > 20
