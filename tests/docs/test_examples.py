"""Run the examples in docstrings, and the program for PYNQ on models of its hardware."""

import doctest
import re
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from eskin.model.bus.axi_lite import ACCESS_CLOCKS
from eskin.model.bus.axi_stream import AxiStream, Event
from eskin.model.bus.config import BusConfig
from eskin.model.config import ReadoutConfig
from eskin.model.registers.export import c_header
from eskin.model.registers.file import RegisterFile, Write

EXAMPLES = {
    "eskin.app.make": "typed_variables",
    "eskin.base.shapes": "misfit",
    "eskin.model.config": "ReadoutConfig",
    "eskin.model.taxel": "encode",
    "eskin.model.readout": "simulate",
    "eskin.model.events.recording": "Recording",
    "eskin.flow.asic.synthesis": "single_bits",
    "eskin.flow.liberty.boolean": "possible",
    "eskin.snn.kernels.layer": "layer",
    "eskin.snn.exchange.transforms": "LevelCrossing",
}


@pytest.mark.parametrize(("name", "of"), EXAMPLES.items())
def test_the_examples_of(name: str, of: str) -> None:
    module = import_module(name)
    found = {test.name: test for test in doctest.DocTestFinder().find(module)}
    assert found[f"{name}.{of}"].examples
    assert doctest.testmod(module).failed == 0


def offsets(header: str) -> dict[str, int]:
    """Return the offset of every register in the structure of a C header."""
    found, place = {}, 0
    for bits, name, count in re.findall(r"^    uint(\d+)_t (\w+)(?:\[(\w+)\])?;$", header, re.MULTILINE):
        found[name.upper()] = place
        place += int(bits) // 8 * int(count or "1", 0)
    return found


def test_the_program_for_pynq_uses_the_offsets_of_the_header_and_reads_every_event(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = (Path(__file__).parents[2] / "docs/guide/verilog.md").read_text()
    ((command, program),) = re.findall(r"(eskin verilog [^\n]*--bus axi.*?)$.*?```python\n(.*?)```", page, re.M | re.S)
    config = BusConfig(
        readout=ReadoutConfig(registers="spi"), time_bits=int(command.split("--time-bits ")[1].split()[0])
    )
    assert f"takes {ACCESS_CLOCKS} clocks" in page
    named = re.search(r"^(.*) = (.*)  # eskin_registers.h$", program, re.MULTILINE)
    assert named is not None
    used = dict(zip(named[1].split(", "), (int(word, 0) for word in named[2].split(", ")), strict=True))
    assert used.items() <= offsets(c_header(config.readout)).items()

    file, stream, sent = RegisterFile(config.readout), AxiStream(config), []

    class Memory:
        def __init__(self, address: int, size: int) -> None:
            assert (address, size) == (0x43C00000, 0x1000)

        def read(self, offset: int) -> int:
            return file.read(offset)

        def write(self, offset: int, word: int) -> None:
            assert file.at[offset].allows(word)
            file.clock(Write(offset, word))

    class Channel:
        transferred = 0

        def transfer(self, words: np.ndarray) -> None:
            row = len(sent) // len(words) % config.readout.rows
            for column in range(config.readout.columns):
                sent.append((1024 * len(sent), row, column))
                words[column] = stream.word(Event(column, row, 1), sent[-1][0])
            self.transferred = words.nbytes

        def wait(self) -> None:
            pass

    pynq = ModuleType("pynq")
    design = SimpleNamespace(ip_dict={"eskin_axi_0": {"phys_addr": 0x43C00000}}, axi_dma_0=SimpleNamespace())
    design.axi_dma_0.recvchannel = Channel()
    vars(pynq).update(MMIO=Memory, Overlay=lambda name: design, allocate=lambda shape, dtype: np.zeros(shape, dtype))
    monkeypatch.setitem(sys.modules, "pynq", pynq)
    exec(program, {})
    *lines, last = capsys.readouterr().out.splitlines()
    assert lines == [f"clock {clock}: row {row}, column {column}, ON" for clock, row, column in sent]
    assert last == "0 events"
    assert file.words[used["RESOLUTION"]] == 4
