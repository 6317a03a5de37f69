"""Generate a testbench beside the Verilog: samples, and expected events from the model."""

from __future__ import annotations

import numpy as np

from eskin.model.address_events import Events
from eskin.model.config import ReadoutConfig
from eskin.model.readout import Stimulus, simulate

TICKS = 8
"""Sample ticks that are played."""


def has_testbench(config: object) -> bool:
    """Return True if a design has a testbench, which needs a digital front end and a stream link."""
    if type(config) is not ReadoutConfig:  # a skin of tiles is one too, with other ports
        return False
    return config.frontend == "digital" and config.link == "stream" and config.registers == "none"


def _played(config: ReadoutConfig) -> tuple[list[int], Events]:
    """Return the samples of every tick as one word, and the expected events."""
    full = 1 << (config.sample_bits - 1)
    taxel = np.arange(config.taxels)
    levels = np.arange(1, TICKS + 1)[:, None] * (taxel % 5 + 2) * config.step // 8
    samples = np.clip(levels * np.where(taxel % 3 == 2, -1, 1), -full, full - 1).astype(np.int32)
    events = simulate(config, Stimulus.from_samples(config, samples))
    mask = (1 << config.sample_bits) - 1
    words = [sum((int(value) & mask) << (i * config.sample_bits) for i, value in enumerate(row)) for row in samples]
    return words, events


def testbench(config: ReadoutConfig) -> str:
    """Return a SystemVerilog testbench that plays samples and compares every event with the model.

    It prints one line with PASSED or FAILED, and ends with ``$fatal`` where an event is missing, wrong or too much:
    the simulator then returns an error.
    """
    words, events = _played(config)
    wide = config.taxels * config.sample_bits
    fields = [(config.has_polarity, "event_polarity", 1), (config.row_bits, "event_row", config.row_bits)]
    fields.append((config.column_bits, "event_col", config.column_bits))
    present = [(name, bits) for there, name, bits in fields if there]
    values = {"event_polarity": "p", "event_row": "y", "event_col": "x"}
    expected = []
    for event in events:
        word = 0
        for name, bits in present:
            word = word << bits | int(event[values[name]])
        expected.append(word)
    width = max(1, sum(bits for _, bits in present))
    seen = "{" + ", ".join(name for name, _ in present) + "}" if present else "1'b0"
    wires = "".join(f"  wire [{bits - 1}:0] {name};\n" for name, bits in present)
    pins = "".join(f", .{name}({name})" for name, _ in present)
    return f"""\
`timescale 1ns/1ps
// {TICKS} sample ticks of {config.clocks_per_sample} clocks; {len(events)} events, as the model gives them.
module eskin_readout_tb;
  reg clk = 1'b0;
  reg rst = 1'b1;
  reg sample_valid = 1'b0;
  reg [{wide - 1}:0] sample = {wide}'h0;
  reg [{wide - 1}:0] samples [0:{TICKS - 1}];
  reg [{width - 1}:0] expected [0:{max(len(events) - 1, 0)}];
  wire event_valid;
{wires}  integer seen = 0;
  integer errors = 0;
  integer tick;
  eskin_readout readout(.clk(clk), .rst(rst), .taxel_enable({{{config.taxels}{{1'b1}}}}), .sample(sample),
      .sample_valid(sample_valid), .event_valid(event_valid), .event_ready(1'b1){pins});
  always #5 clk = ~clk;
  always @(negedge clk)
    if (!rst && event_valid) begin
      if (seen >= {len(events)} || {seen} !== expected[seen]) errors = errors + 1;
      seen = seen + 1;
    end
  initial begin
{"".join(f"    samples[{i}] = {wide}'h{word:x};{chr(10)}" for i, word in enumerate(words))}\
{"".join(f"    expected[{i}] = {width}'h{word:x};{chr(10)}" for i, word in enumerate(expected))}\
    repeat (3) @(negedge clk);
    rst = 1'b0;
    for (tick = 0; tick < {TICKS}; tick = tick + 1) begin
      sample = samples[tick];
      sample_valid = 1'b1;
      @(negedge clk) sample_valid = 1'b0;
      repeat ({config.clocks_per_sample - 1}) @(negedge clk);
    end
    repeat ({len(events) + 4 * config.taxels + 16}) @(negedge clk);
    if (errors == 0 && seen == {len(events)} && seen > 0) begin
      $display("PASSED: %0d events", seen);
      $finish;
    end
    $fatal(1, "FAILED: %0d of {len(events)} events, %0d of them wrong", seen, errors);
  end
endmodule
"""
