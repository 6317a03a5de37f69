"""Test the commands behind make sim and make replay, also with a faulty RTL."""

import dataclasses
import json
import os
import re
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import eskin.base.progress as progress
import eskin.cocotb_tests.runner.simulator as simulator
from eskin.cocotb_tests.bench.stimuli import settled
from eskin.cocotb_tests.runner.build_cache import ROOT
from eskin.cocotb_tests.runner.process import MismatchFound, play_runs, scenario_runs
from eskin.cocotb_tests.runner.reproduce import reproduce
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from eskin.model.readout import simulate
from eskin.rtl.verilog import verilog
from eskin.skin.textures.dataset import embedded_dataset
from eskin.skin.textures.physical import PhysicalScan
from tests.conftest import Call

BIT_EXACT = re.compile(r"bit-exact: (\d+) runs, (\d+) clocks, (\d+) events, 0 mismatches")
OURS = {"PYTHONPATH": str(ROOT)}  # from another folder, the code that is installed would run, not this checkout's
COMMAND = [sys.executable, "-m", "eskin"]


def counts(out: str) -> tuple[int, int]:
    """Return the numbers of runs and events in the last line of a run without mismatch."""
    line = BIT_EXACT.fullmatch(out.strip().splitlines()[-1])
    assert line is not None, out
    return int(line[1]), int(line[3])


@pytest.mark.command("sim")
def test_sim_ends_with_its_one_line_and_leaves_picture_and_event_files(call: Call, folder: Path) -> None:
    options = "--rows 2 --columns 3 --encoding cw-lcs --sim icarus --textures 2 --ticks 60 --waves -o out"
    code, out, err = call("sim", options)
    assert code == 0, err
    runs, events = counts(out)
    assert runs == 9 + 2
    assert events > 0
    place = folder / "out" / "2x3-cw-lcs-6b"
    assert (place / "raster.png").stat().st_size > 10_000
    rtl, model = Recording.load(place / "rtl.npz"), Recording.load(place / "model.npz")
    assert len(rtl.events) > 0
    assert np.array_equal(rtl.events, model.events)
    wave = re.search(r"waveform: (\S+); open it with: gtkwave", out)
    assert wave is not None
    assert Path(wave[1]).stat().st_size > 1000


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("--sim modelsim", "error: SIM must be one of verilator, icarus, not 'modelsim'\n"),
        ("--only sky", "error: dataset embedded has no texture 'sky'; one of them is brick/brick-00\n"),
    ],
)
def test_bad_input_is_one_sentence(line: str, sentence: str, refuses: Callable[..., None]) -> None:
    refuses(sentence, "sim -o out", line)


WRAPPER = """
`default_nettype none
`include "size.vh"
module theirs #(parameter BITS = 12) (
    input wire ck, nrst, strobe, ack, input wire [2*`ROWS-1:0] mask, input wire [2*`ROWS*BITS-1:0] data,
    output wire req, output wire [2:0] addr);
  eskin_readout core (.clk(ck), .rst(~nrst), .taxel_enable(mask), .sample_valid(strobe), .sample(data), .aer_req(req),
                      .aer_ack(ack), .aer_addr(addr));
endmodule
module wrapper(clk, rst, taxel_enable, sample_valid, sample, aer_req, aer_ack, aer_addr);
  input wire clk, rst, sample_valid, aer_ack;
  input wire [3:0] taxel_enable;
  input wire [47:0] sample;
  output wire aer_req;
  output wire [2:0] aer_addr;
  theirs it (.ck(clk), .nrst(~rst), .mask(taxel_enable), .strobe(sample_valid), .data(sample), .req(aer_req),
             .ack(aer_ack), .addr(aer_addr));
endmodule
"""


def test_a_readout_of_the_user_is_held_to_the_model(call: Call, refuses: Callable[..., None], folder: Path) -> None:
    text = verilog(ReadoutConfig(rows=2, columns=2, link="four_phase"))
    Path("core.v").write_text(text)
    Path("size.vh").write_text("`ifndef ROWS\n`define ROWS 2\n`endif\n")  # a macro of the harness, too
    Path("wrapper.v").write_text(WRAPPER)
    options = "sim --rows 2 --columns 2 --sim icarus --textures 0 -o out --dut"
    theirs = f"{options} wrapper.v --top wrapper --link four_phase --dut"
    _, out, err = call(theirs, "core.v")
    assert out.startswith("wrapper.v, core.v, 2 x 2 taxels, link four_phase: 9 scenarios and 0 scans for each of lcs\n")
    runs, events = counts(out)
    assert (runs, events > 100) == (9, True), err

    right = "{event_polarity, event_row, event_col}"
    Path("bug.v").write_text(text.replace(right, "{event_polarity ^ (event_row & event_col), event_row, event_col}"))
    code, out, _ = call(theirs, "bug.v")
    assert code == 1
    assert re.search(r"differs in polarity: model clock (\d+), row 1, column 1, (ON|OFF); RTL clock \1", out)
    assert "\n  clock " in out  # the model's state
    again = r"reproduce: eskin sim .*--link four_phase .*--dut /\S+/wrapper.v --dut /\S+/bug.v --top wrapper\n"
    assert re.search(again, out)
    assert re.search(r"MISMATCH; equal runs before it: \d; report: out/\S+/run/mismatch.txt\n", out)
    wrong = "the model has --rows 2 --columns 2 --encoding lcs --sample-bits 12 --resolution 5 "
    assert wrong in call(theirs, "core.v --resolution 5")[1]

    early = WRAPPER.replace(".addr(aer_addr)", ".addr(a)").replace(
        "theirs it", "wire [2:0] a; assign aer_addr = a ^ {3{aer_ack & ~aer_req}}; theirs it"
    )
    high = WRAPPER.replace(".req(aer_req)", ".req(r)").replace(
        "theirs it", "wire r; assign aer_req = r | rst; theirs it"
    )
    Path("early.v").write_text(early)
    Path("high.v").write_text(high)
    Path("x.v").write_text(text.replace(right, "{event_polarity, event_row, event_col & (event_row ? 1'bx : 1'b1)}"))
    changes = (
        r"breaches of the protocol, first in clock \d+: the address changes while REQ or ACK is high\nreproduce: eskin"
    )
    stuck = "the request stays high or unknown in reset, so no run can begin; reproduce: eskin sim"
    for files, sentence in {
        f"{options} early.v --top wrapper --link four_phase --dut core.v": changes,
        f"{options} high.v --top wrapper --link four_phase --dut core.v": stuck,
        f"{theirs} x.v": r"the event in clock \d+ has an unknown address or polarity",
    }.items():
        code, out, _ = call(files)
        assert code == 1
        assert re.search(sentence, out), out

    Path("open.v").write_text(text.replace("endmodule", "endmodul", 1))
    lacking = "".join(f"absent a{number} ();\n" for number in range(120))  # more than 4000 characters of errors
    Path("long.v").write_text(text.replace("endmodule", f"{lacking}endmodule", 1))
    end = text.index("endmodule")
    first, second = text[:end].count("\n") + 1, text[: text.index("\nmodule", end)].count("\n") + 1
    other = "; give the configuration of your Verilog, for example with --config eskin_readout.json, or write a wrapper"
    unbuilt, needs = "the Verilog cannot be built: ", "; give its configuration and all modules that it uses"
    refused = {
        "core.v": "as a readout of 2 x 2 taxels with lcs and link stream, module eskin_readout lacks event_valid "
        "(output, 1 bit), lacks event_ready (input, 1 bit), lacks event_row (output, 1 bit), lacks event_col (output, "
        f"1 bit), lacks event_polarity (output, 1 bit), has the unknown input aer_ack{other} and name it with --top",
        "core.v --link four_phase --rows 4": "as a readout of 4 x 2 taxels with lcs and link four_phase, module "
        "eskin_readout has taxel_enable (input, 4 bits) in place of (input, 8 bits), has sample (input, 48 bits) in "
        "place of (input, 96 bits), has aer_addr (output, 3 bits) in place of (output, 4 bits)"
        f"{other} and name it with --top",
        "wrapper.v": "the Verilog contains no module eskin_readout (its modules: theirs, wrapper); name the top with "
        "--top",
        "open.v --link four_phase": f"{unbuilt}open.v:{second + 1}: syntax error{needs}",
        "long.v --link four_phase": f"{unbuilt}long.v:{first}: error: Unknown module type: absent{needs}",
        "wrapper.v --link four_phase --top wrapper": f"{unbuilt}wrapper.v:7: error: Unknown module type: eskin_readout"
        f"{needs}",
    }
    for line, sentence in refused.items():
        code, _, err = call(options, line)
        assert (code, err) == (2, f"error: {sentence}\n")


HOST_BUGS = {
    "a window that closes at == for >=": ("last_part >= period", "last_part == period"),
    "a mask bit without effect": (
        "mask_rest_taxels <= write_data[11:0]",
        "mask_rest_taxels <= {write_data[11:1], 1'b1}",
    ),
    "a field that is never off": ("& {choice[23:22] != 2'h3", "& {1'h1"),
    "a counter that reads 0": ("(events_count_bits & {32{at_events}})", "32'h0"),
}


def test_sim_plays_a_host_that_sets_registers_while_events_flow(call: Call, folder: Path) -> None:
    array = {"rows": 3, "columns": 4, "encoding": "cw-lcs", "registers": "spi", "receptive_fields": "settable"}
    text = verilog(ReadoutConfig.from_dict(array))
    Path("right.v").write_text(text)
    words = " ".join(f"--{name.replace('_', '-')} {value}" for name, value in array.items())
    options = f"sim {words} --sim icarus --textures 0 -o out --dut"
    code, out, err = call(options, "right.v")
    assert (code, counts(out)[0]) == (0, 10), err
    covered = (
        r"cw-lcs: a host sets over SPI, while events flow: resolution \(\d values\), window_period \(\d values\), "
        r"test_mode \(3 values\), fields \(4 values\), masks \(\d+ values\)"
    )
    assert re.search(f"^{covered}$", out, re.MULTILINE), out
    for name, (right, wrong) in HOST_BUGS.items():
        assert text.count(right) == 1, name
        Path("bug.v").write_text(text.replace(right, wrong))
        code, out, _ = call(options, "bug.v")
        assert code == 1, name
        assert "\nMISMATCH; equal runs before it: 9; " in out


SMALL = "sim --rows 1 --columns 1 --encoding lcs --sim icarus --ticks 40"
REPLAY = "replay --dataset embedded --rows 2 --columns 2 --encoding nlcs"


@pytest.mark.parametrize("command", [SMALL, REPLAY], ids=["sim", "replay"])
def test_a_damaged_image_is_one_sentence(command: str, call: Call, folder: Path) -> None:
    (folder / "textures" / "brick").mkdir(parents=True)
    (folder / "textures" / "brick" / "half.png").write_bytes(b"\x89PNG\r\n\x1a\n half")
    code, _, err = call(command, "--dataset textures -o out")
    assert code == 2
    assert err.splitlines()[-1].startswith("error: image ")


@pytest.mark.command("replay")
def test_replay_is_bit_exact_and_does_only_what_is_missing(call: Call, folder: Path) -> None:
    for texture in embedded_dataset().limit(3):
        picture = folder / "textures" / f"{texture.name}.png"
        picture.parent.mkdir(parents=True)
        Image.fromarray(texture.load()).save(picture)
    code, _, err = call(REPLAY, "--dataset textures --workers 2 -o out")
    assert code == 0, err
    next(folder.glob("out/*/events/grass/*.npz")).write_bytes(b"damaged")
    other = next(folder.glob("out/*/events/brick/*.npz"))
    recording = Recording.load(other)  # of another RTL, model or image
    dataclasses.replace(recording, metadata=recording.metadata | {"proof": "another"}).save(other)
    out = call(REPLAY, "--dataset textures -o out")[1]
    assert "played now: 2 images" in out
    summary = json.loads(next(folder.glob("out/*/summary.json")).read_text())
    assert counts(out) == (3, summary["events"])
    assert summary["events"] > 0
    config = ReadoutConfig.from_dict(summary["configuration"])
    for texture in embedded_dataset().limit(3):
        recording = Recording.load(next(folder.glob("out/*/events")) / f"{texture.name}.npz")
        samples, _ = PhysicalScan().samples(config, texture.load())
        assert np.array_equal(recording.events, simulate(config, settled(config, samples)))
        assert recording.metadata["class"] == texture.class_name


def test_replay_goes_on_after_a_kill(call: Call, folder: Path) -> None:
    words = f"{REPLAY} --limit 12 --workers 1 -o out".split()
    killed = subprocess.Popen([*COMMAND, *words], stderr=subprocess.DEVNULL, env=os.environ | OURS)
    deadline = time.monotonic() + 120
    while not list(folder.glob("out/*/events/*/*.npz")):
        assert killed.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.02)
    killed.kill()
    killed.wait()
    code, out, err = call(*words)
    assert code == 0, err
    assert counts(out)[0] == 12
    assert "played now: 12 images" not in out


def test_a_link_too_slow_for_the_signal_is_said_before_and_is_no_failure(
    call: Call, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress, "SILENCE_S", 0.01)
    monkeypatch.setattr(simulator, "BUILD", folder / "build")  # a kept program would not be built
    array = "--rows 4 --columns 4 --resolution 8 --link four_phase --clocks-per-sample 4"
    leak = "--encoding nlcs --leak-period 1 --leak-shift 1"
    code, out, err = call("sim", array, leak, "--only brick/brick-00 --ticks 40 --sim icarus -o out")
    assert code == 0, out + err
    warning, *waiting = [line for line in err.splitlines() if not line.startswith("nlcs: ")]
    assert warning == (
        "warning: nlcs 8 b, 4 x 4 taxels: the link is too slow for the busiest samples: of 2559 events 0 leave after "
        "the next sample and 2536 merge with others, at a mean load of 100%; a faster clock helps, with "
        "--clocks-per-sample 16384 (an estimate)"
    )
    assert re.fullmatch(r"building 4 x 4 taxels for icarus: \d+ s so far", waiting[0])
    *_, picture, rest, line = out.splitlines()
    assert picture == "picture: out/4x4-nlcs-8b/raster.png; event files: out/4x4-nlcs-8b/events"
    assert (folder / "out/4x4-nlcs-8b/raster.png").exists()
    assert rest.startswith("no run came to rest: only sent events were compared")
    assert BIT_EXACT.fullmatch(line)


FAULTS = {
    "polarity swapped": ("event_polarity = |(", "event_polarity = ~|("),
    "columns served in the wrong row": ("event_row <= select[2:1]", "event_row <= 2'h0"),
    "an event lost now and then": ("assign event_valid = |waiting", "assign event_valid = |waiting[3:1]"),
    "silent": ("assign event_valid = |waiting", "assign event_valid = 1'h0"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_broken_readout_is_found_and_described(fault: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    config = ReadoutConfig(rows=3, columns=4)
    text = simulator.verilog_text(config)
    before, after = FAULTS[fault]
    assert before in text
    monkeypatch.setattr(simulator, "verilog_text", lambda _: text.replace(before, after, 1))
    monkeypatch.setattr(simulator, "BUILD", tmp_path)
    runs = scenario_runs(config, 0, reproduce(config, "icarus", 0))
    with pytest.raises(MismatchFound) as found:
        play_runs(simulator.build(config, "icarus"), runs, tmp_path / "run")
    message = str(found.value)
    assert "RTL and model differ" in message
    assert re.search(r"clock \d+: sample -?\d+, reference -?\d+, half-width \d+, pending [01]", message)
    assert message.endswith("reproduce: " + reproduce(config, "icarus", 0))
    assert reproduce(config, "icarus", 0) == "eskin sim --rows 3 --columns 4 --sim icarus --seed 0 --textures 0 --waves"


@pytest.mark.parametrize("planted", ["", "run", "events", "events/brick"])
def test_sim_follows_no_link_in_its_folder(planted: str, call: Call, folder: Path) -> None:
    victim = folder / "victim"
    victim.mkdir()
    link = folder / "out" / "1x1-lcs-6b" / planted
    link.parent.mkdir(parents=True)
    link.symlink_to(victim)
    code, _, err = call(SMALL, f"--textures 1 -o {folder / 'out'}")
    assert code == 2
    assert err.splitlines()[-1] == f"error: cannot write to {link}: it is a link to another place; remove it"
    assert not list(victim.iterdir())


def test_sim_replaces_links_to_files_in_its_folder(call: Call, folder: Path) -> None:
    victim = folder / "victim"
    victim.write_text("mine")
    names = ("rtl.npz", "model.npz", "raster.png", "run/job.json", "run/simulation.log")
    links = [folder / "out" / "1x1-lcs-6b" / name for name in names]
    for link in links:
        link.parent.mkdir(parents=True, exist_ok=True)
        link.symlink_to(victim)
    code, _, err = call(SMALL, "--textures 1 -o out")
    assert code == 0, err
    assert not any(link.is_symlink() for link in links)
    assert victim.read_text() == "mine"


def test_a_full_disk_is_one_sentence(tmp_path: Path) -> None:
    def no_file_above_8_kb() -> None:  # a program meets the same error, too late, as on a full disk
        resource.setrlimit(resource.RLIMIT_FSIZE, (8_000, 8_000))

    command = [*COMMAND, *SMALL.split(), "--textures", "0", "-o", str(tmp_path / "out")]
    done = subprocess.run(
        command, capture_output=True, text=True, env=os.environ | OURS, preexec_fn=no_file_above_8_kb, check=False
    )
    assert done.returncode == 2
    last = done.stderr.splitlines()[-1]  # the folder of the run; without a kept build, already that of Yosys
    assert re.fullmatch(r"error: cannot write to \S+: File too large", last)
