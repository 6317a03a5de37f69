"""Test the register description: addresses, C header, Python class, page and model agree."""

import dataclasses
import random
import re
import shutil
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from eskin.base.errors import InputError
from eskin.model import window
from eskin.model.config import ReadoutConfig
from eskin.model.encoders import registry
from eskin.model.readout import Stimulus, simulate
from eskin.model.registers import settings
from eskin.model.registers.description import NAME, WORD_BITS, registers
from eskin.model.registers.driver import Registers
from eskin.model.registers.export import c_header, ip_xact, page, system_rdl
from eskin.model.registers.file import RegisterFile, Settings, Write
from eskin.model.registers.spi import COMMAND_BITS, Pins, SpiSlave
from tests.model.refused import refused

CONFIG = ReadoutConfig(registers="spi")
CONFIGS = [
    CONFIG,
    CONFIG.replace(rows=3, columns=5, encoding="nlcs"),
    CONFIG.replace(rows=1, columns=1, encoding="cw-lcs"),
    CONFIG.replace(rows=5, columns=9),
    CONFIG.replace(rows=64, columns=64),
]


class Chip:
    """SPI slave and register file with an adapter of 8 clocks per bit."""

    def __init__(self, config: ReadoutConfig) -> None:
        self.slave, self.file = SpiSlave(), RegisterFile(config)
        self.hold(Pins(), 6)

    def hold(self, pins: Pins, clocks: int) -> None:
        for _ in range(clocks):
            write = self.slave.write
            self.slave.clock(pins, self.file.read(self.slave.address))
            self.file.clock(write)

    def exchange(self, sent: bytes) -> bytes:
        found = 0
        self.hold(Pins(cs_n=0), 3)
        for place in reversed(range(8 * len(sent))):
            bit = int.from_bytes(sent, "big") >> place & 1
            self.hold(Pins(0, 0, bit), 4)
            found = found << 1 | self.slave.miso
            self.hold(Pins(1, 0, bit), 4)
        self.hold(Pins(cs_n=0), 4)
        self.hold(Pins(), 4)
        return found.to_bytes(len(sent), "big")


@pytest.mark.parametrize("config", CONFIGS, ids=lambda c: f"{c.rows}x{c.columns}-{c.encoding}")
def test_the_mask_has_a_bit_for_each_taxel_and_settings_begin_as_built(config: ReadoutConfig) -> None:
    found = registers(config)
    masks = [register for register in found if register.name.startswith("mask")]
    assert sum(field.width for register in masks for field in register.fields) == config.taxels
    file = RegisterFile(config)
    assert Settings.of(config, file.signals()) == Settings(
        config.resolution, config.leak_shift, config.leak_period, config.window_period, (1 << config.taxels) - 1
    )
    for register in masks:
        file.clock(Write(register.address, 0))
    assert Settings.of(config, file.signals()).mask == 0


def test_the_register_shape_describes_the_code_of_every_encoder() -> None:
    (encoding,) = (f for register in registers(CONFIG) for f in register.fields if f.name == "encoding")
    assert encoding.meaning == ", ".join(f"{one.code}: {one.title}" for one in registry.ENCODERS)


@pytest.mark.parametrize("config", CONFIGS[1:4:2], ids=lambda c: f"{c.rows}x{c.columns}-{c.encoding}")
def test_the_header_compiles_and_says_what_the_python_class_says(config: ReadoutConfig, tmp_path: Path) -> None:
    compiler = shutil.which("gcc") or shutil.which("g++")
    assert compiler, "gcc not found; install with: apt-get install g++"
    (tmp_path / "eskin_registers.h").write_text(c_header(config))
    expected = {}
    for register in registers(config):
        place = f"{NAME}__{register.name}{'' if register.index is None else 'x'}".upper()
        for field in register.fields:
            mask = (1 << field.width) - 1 << field.low
            numbers = {"bm": mask, "bp": field.low, "bw": field.width, "reset": field.reset}
            expected |= {f"{place}__{field.name.upper()}_{end}": number for end, number in numbers.items()}
    lines = [f'  printf("{key} %lu\\n", (unsigned long)({key}));' for key in expected]
    offsets = {register.key: register.address for register in registers(config)}
    lines += [f'  printf("{key} %lu\\n", (unsigned long)offsetof(eskin_registers_t, {key}));' for key in offsets]
    head = ["#include <stddef.h>", "#include <stdio.h>", '#include "eskin_registers.h"', "int main(void) {"]
    (tmp_path / "main.c").write_text("\n".join([*head, *lines, "  return 0;", "}", ""]))
    command = [compiler, "-Wall", "-Werror", "-x", "c", "-std=c11", "main.c", "-o", "main"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    said = subprocess.run([tmp_path / "main"], capture_output=True, text=True).stdout
    assert {line.split()[0]: int(line.split()[1]) for line in said.splitlines()} == expected | offsets
    defined = set(re.findall(r"^#define (\w+_(?:bm|bp|bw|reset)) ", c_header(config), re.MULTILINE))
    assert defined == set(expected)


@pytest.mark.parametrize("config", CONFIGS[1:], ids=lambda c: f"{c.rows}x{c.columns}-{c.encoding}")
@pytest.mark.parametrize("form", ["rdl", "xml"])
def test_system_rdl_and_ip_xact_describe_the_registers(config: ReadoutConfig, form: str, tmp_path: Path) -> None:
    from peakrdl_ipxact import IPXACTImporter
    from systemrdl import RDLCompiler, RegNode

    config = config.replace(receptive_fields="settable", resolution=5, leak_shift=3)
    path = tmp_path / f"registers.{form}"
    path.write_text(system_rdl(config) if form == "rdl" else ip_xact(config))
    compiler = RDLCompiler()
    compiler.compile_file(str(path)) if form == "rdl" else IPXACTImporter(compiler).import_file(str(path))
    found = {}
    for node in (n for n in compiler.elaborate().top.descendants(unroll=True) if isinstance(n, RegNode)):
        key = node.inst_name + (f"[{node.current_idx[0]}]" if node.is_array else "")
        fields = [
            (f.inst_name, f.low, f.width, f.get_property("reset"), f.is_sw_readable, f.is_sw_writable)
            for f in node.fields()
        ]
        found[key] = (node.absolute_address, node.get_property("regwidth"), fields)
    assert found == {
        register.key: (
            register.address,
            WORD_BITS,
            [
                (f.name, f.low, f.width, f.reset, f.kind != "pulse", f.kind in ("setting", "pulse"))
                for f in register.fields
            ],
        )
        for register in registers(config)
    }


def test_the_python_class_reads_what_it_wrote_through_slave_and_file() -> None:
    config = CONFIG.replace(rows=5, columns=9, encoding="nlcs")
    chip = Registers(config, Chip(config).exchange)
    assert chip.read("id") == {"map": 1, "chip": 0xE5C1}
    assert chip.read("shape")["columns"] == 9
    chip.write("decay", period=12)
    assert chip.read("decay") == {"period": 12, "shift": config.leak_shift}
    chip.write("test", mode=2, row=4, column=8)
    assert chip.read("test")["column"] == 8
    chip.silence([0, 33, 44])
    assert chip.read_word("mask[0]") == 0xFFFFFFFE
    assert chip.read_word("mask_rest") == (1 << 13) - 1 - 2 - (1 << 12)
    chip.write("control", clear=1)
    assert chip.read_word("control") == 0


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda chip: chip.write("resolution", bits=7), "resolution.bits must be in 1..6, not 7"),
        (lambda chip: chip.write("resolution", bits=0), "resolution.bits must be in 1..6, not 0"),
        (lambda chip: chip.write("id", map=2), "register id can only be read"),
        (lambda chip: chip.write("test", speed=1), "test has no field 'speed'; it has mode, on, turns"),
        (lambda chip: chip.read("gain"), "there is no register 'gain'; the registers are id, version"),
        (lambda chip: Registers(ReadoutConfig(), chip.exchange), "the configuration has no registers"),
    ],
)
def test_the_driver_refuses_wrong_values_and_unknown_names(call: object, sentence: str) -> None:
    chip = Registers(CONFIG, Chip(CONFIG).exchange)
    with pytest.raises(InputError, match=re.escape(sentence)):
        call(chip)  # type: ignore[operator]


def test_a_transfer_that_is_broken_off_anywhere_writes_nothing() -> None:
    rng = random.Random(5)
    chip = Chip(CONFIG)
    before = dict(chip.file.words)
    sent = (1 << 15 | 0x1C) << WORD_BITS | 0x0000_0002
    for count in range(COMMAND_BITS + WORD_BITS):
        chip.hold(Pins(cs_n=0), 3)
        for place in range(count):
            bit = sent >> COMMAND_BITS + WORD_BITS - 1 - place & 1
            chip.hold(Pins(0, 0, bit), 2)
            chip.hold(Pins(1, 0, bit), 2)
        chip.hold(Pins(sck=rng.randrange(2)), 5)
        chip.hold(Pins(), 4)
    assert chip.file.words == before
    chip.exchange(sent.to_bytes(6, "big"))
    assert chip.file.words != before


def test_the_page_names_every_field_of_its_configuration() -> None:
    for config in CONFIGS[:3]:
        text = page(config)
        for register in registers(config):
            assert f"`{register.name}`" in text
            assert all(f"`{field.name}`" in text and field.meaning in text for field in register.fields)
    assert re.findall(r"[\d.]+ [kM]Hz", page(CONFIG)) == ["1.28 MHz", "160 kHz", "320 kHz"]  # clock, read, write


def test_without_the_compiler_it_is_a_sentence() -> None:
    code = (
        "import sys; sys.modules['systemrdl'] = None\n"
        "from eskin.model.config import ReadoutConfig\nfrom eskin.model.registers.description import registers\n"
        "try:\n    registers(ReadoutConfig(registers='spi'))\nexcept Exception as error:\n    print(type(error), error)"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout
    assert "InputError" in said
    assert "this needs systemrdl-compiler, which is not installed; in the checkout: make setup FOR=registers" in said


def test_a_window_that_was_quiet_for_longer_than_a_shorter_period_closes_with_the_next_tick() -> None:
    taxel, written = SimpleNamespace(quiet=30, closed=0), SimpleNamespace(window_period=10, levels_log2=2)
    closes = window.pass_tick
    assert closes(written, taxel)
    assert (taxel.quiet, taxel.closed) == (0, 1)
    assert [closes(written, taxel) for _ in range(10)] == [False] * 9 + [True]


RISE, BUILT = "the clocks of settings must rise from 0", "a resolution must be in 1..6, the built one"


@pytest.mark.parametrize(
    ("clocks", "coarser", "host", "sentence"),
    [
        ([], 0, "spi", ""),
        ([0, 1, 7], 5, "spi", ""),
        ([], 0, "none", ""),
        *(([*clocks], 0, "spi", RISE) for clocks in ((1, 5), (0, 5, 5), (0, 5, 4))),
        *(([0], coarser, "spi", BUILT) for coarser in (-1, 6)),
        ([0], 0, "none", "settings need registers; build the readout with registers=spi"),
    ],
)
def test_settings_are_those_of_a_host_from_clock_0_on_or_one_sentence(
    clocks: list[int], coarser: int, host: Any, sentence: str
) -> None:
    given = np.zeros(len(clocks), settings.SETTING_DTYPE)
    given["t"], given["coarser"] = clocks, coarser
    with refused(sentence) if sentence else nullcontext():
        settings.check(ReadoutConfig(registers=host, resolution=6), given)


@pytest.mark.parametrize("encoding", registry.NAMES)
@pytest.mark.parametrize("pace", ["clock", "sample"])
def test_a_resolution_that_a_host_sets_gives_the_events_of_a_readout_built_with_it(encoding: Any, pace: Any) -> None:
    """Compare a resolution set by the host with a readout built with that resolution."""
    rng = np.random.default_rng(11)
    for bits, built, steps in [(12, 8, 2), (12, 10, 0), (10, 4, 4), (6, 3, 1)]:
        shape = {"rows": 2, "columns": 2, "sample_bits": bits, "window_period": 2, "closing_shift": steps}
        config = ReadoutConfig(**shape, encoding=encoding, decide_every=pace, resolution=built, clocks_per_sample=8)
        walk = np.cumsum(rng.integers(-3, 4, (300, 4)), axis=0) * config.full_scale // 64
        walk = walk.clip(-config.full_scale, config.full_scale - 1)
        for resolution in range(1, built + 1):
            coarse = config.replace(resolution=resolution)
            made = Stimulus.from_samples(config, walk)
            given = np.zeros(1, settings.SETTING_DTYPE)
            for name in ("leak_shift", "leak_period", "window_period"):
                given[name] = getattr(config, name)
            given["coarser"] = built - resolution
            told = simulate(config.replace(registers="spi"), dataclasses.replace(made, settings=given))
            assert len(told) > 8 or resolution < built
            assert np.array_equal(told, simulate(coarse, made)), (bits, built, steps, resolution)


def test_a_window_without_room_for_all_settings_is_refused() -> None:
    """Check that a window without room for all closing steps is rejected."""
    for resolution, closing, most in ((10, 2, 0), (8, 4, 2), (9, 2, 1)):
        sentence = (
            f"closing_shift must be in 0..{most} = sample_bits - 2 - resolution with registers=spi, not {closing}; "
            f"otherwise the window of a coarser resolution does not fit: lower closing_shift, "
            f"or raise sample_bits to {resolution + 2 + closing}"
        )
        fields = {"encoding": "cw-lcs", "resolution": resolution, "closing_shift": closing}
        with refused(sentence):
            ReadoutConfig.from_dict(fields | {"registers": "spi"})
        ReadoutConfig.from_dict(fields | {"registers": "spi", "sample_bits": resolution + 2 + closing})
        ReadoutConfig.from_dict(fields)
