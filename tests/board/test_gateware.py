"""Test a simulated board bit by bit on its serial line with the real host program."""

import json
import os
import random
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cocotb
import numpy as np
import pytest
from cocotb.clock import Clock
from cocotb.triggers import Timer
from cocotb.utils import get_sim_time

from eskin.board.config import BoardConfig, SerialConfig
from eskin.board.gateware.top import TOP, verilog
from eskin.board.sensor import SensorConfig
from eskin.board.session import as_events
from eskin.cocotb_tests.bench.chip import network_of
from eskin.cocotb_tests.bench.line import CLOCK_NS, Line, Spoil
from eskin.cocotb_tests.runner import cocotb_runners as runners
from eskin.cocotb_tests.runner.simulator import build
from eskin.model.classifier.chip import simulate_chip
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.classifier.file import IntegerWeights
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording
from tests.board.adc import Converter, at_the_pins
from tests.board.test_sensor import SETTLE_S, samples_of

JOB = "ESKIN_BOARD_JOB"
BAUD = 12_500_000
TICKS = 40
SERIAL = SerialConfig(baud=BAUD, buffer_bytes=512, idle_bits=4096, records=128)


def small_chip() -> ChipConfig:
    """Return a chip with short bins, in which bursts must wait."""
    readout = ReadoutConfig(rows=3, columns=5, resolution=6, clocks_per_sample=64)
    network = ClassifierConfig(inputs=30, hidden=10, classes=3, threshold=60, floor=-200, lanes=2, bin_s=0.0003)
    return ChipConfig(readout=readout, classifier=network.replace(out_threshold=100, out_floor=-200, margin=2))


def walk(ticks: int, taxels: int) -> np.ndarray:
    steps = np.random.default_rng(2).integers(-60, 61, (ticks, taxels))
    return np.cumsum(steps, axis=0).clip(-2000, 2000).astype(np.int16)


def weights_of(chip: ChipConfig, path: Path) -> Path:
    """Write random weights for a chip."""
    network = network_of(chip)
    training = {"readout": chip.readout.to_dict(), "preset": None, "dataset": "own", "tested": {}}
    training |= {"bin_s": 0.0003, "recordings": None}
    IntegerWeights(network, ("a", "b", "c"), {"training": training}).save(path)
    return path


def flipped(at: int | None) -> Spoil:
    """Return a line disturbance that flips a bit of the byte of a number."""
    return lambda number, byte: byte ^ 0x10 if number == at else byte


# -- within the simulator ----------------------------------------------------------------------------


async def start(dut: Any) -> None:
    dut.rx.value = dut.rst.value = 1
    Clock(dut.clk, CLOCK_NS, "ns").start()
    await Timer(5 * CLOCK_NS, "ns")
    dut.rst.value = 0


@cocotb.test()
async def hosts_come_and_go(dut: Any) -> None:
    """Run several host programs in turn, each with another disturbance of the line."""
    job = json.loads(Path(os.environ[JOB]).read_text())
    pins = [getattr(dut, name) for name in ("aer_req", "aer_req_off", "aer_addr", "miso") if hasattr(dut, name)]
    for pin in pins:
        pin.value = 0
    await start(dut)
    said = {}
    for name, one in job.items():
        for pin in pins:  # a chip whose host ended may stop in the middle of a handshake
            pin.value = 0
        line = Line(dut, BAUD, *(flipped(one.get(way)) for way in ("to_board", "to_host")))
        if "sensor" in one:
            part, settle_s = one["sensor"].values()
            cocotb.start_soon(at_the_pins(dut, Converter(part, np.load(one["codes"]), settle_s * 1e9)))
        words = [sys.executable, "-m", "eskin", *one["words"], "--port", line.port, "--patience", "10"]
        pipes: Any = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
        with subprocess.Popen(words, **pipes, preexec_fn=hears_ctrl_c) as host:
            requests: list[int] = []
            sender = foreign_chip(dut, one["events"], requests) if "events" in one else None
            await line.run(host, one.get("pull_after"), sender, wait_bits=12_000)
            out, err = host.communicate(timeout=60)
        said[name] = {"code": host.returncode, "out": out, "err": err, "requests": requests, "bytes": line.sent}
    Path("said.json").write_text(json.dumps(said))


def hears_ctrl_c() -> None:
    """Enable Ctrl-C in a background process."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


async def foreign_chip(dut: Any, events: list[list[int]], requests: list[int]) -> None:
    """Send addresses over four-phase AER, asynchronously to the board; record the times in ps.

    A third number of an event names its requests: 1 ON (or the only one), 2 OFF, 3 both.
    """
    for wait_ps, address, *which in events:
        pins = [pin for bit, pin in enumerate((dut.aer_req, dut.aer_req_off)) if (which or [1])[0] >> bit & 1]
        await Timer(wait_ps, "ps")
        dut.aer_addr.value = address
        await Timer(1, "ns")
        for pin in pins:
            pin.value = 1
        requests.append(int(get_sim_time("ps")))
        while not int(dut.aer_ack.value):
            await Timer(3_700, "ps")
        for pin in pins:
            pin.value = 0
        while int(dut.aer_ack.value):
            await Timer(3_700, "ps")


# -- outside -----------------------------------------------------------------------------------------


Hosts = Callable[..., dict[str, Any]]


@pytest.fixture
def hosts(tmp_path: Path) -> Hosts:
    """Return a function that runs host programs with a board and gives their output."""

    def run(chip: ChipConfig | None, job: dict[str, Any], sensor: SensorConfig | None = None) -> dict[str, Any]:
        (tmp_path / "job.json").write_text(json.dumps(job))
        text = verilog(BoardConfig(chip=chip, serial=SERIAL, sensor=sensor))
        program = build(chip or small_chip(), "verilator", top=TOP, text=text)
        program.test("tests.board.test_gateware", tmp_path, "hosts_come_and_go", {JOB: str(tmp_path / "job.json")})
        found: dict[str, Any] = json.loads((tmp_path / "said.json").read_text())
        return found

    return run


def test_a_recording_on_the_board_gives_the_events_and_classes_of_the_model(hosts: Hosts, tmp_path: Path) -> None:
    """Check that the host program finds equal events and classes, and detects each line fault."""
    chip = small_chip()
    np.save(tmp_path / "codes.npy", walk(TICKS, chip.readout.taxels))
    weights = weights_of(chip, tmp_path / "weights.npz")
    play = ["play", str(weights), "--samples", str(tmp_path / "codes.npy"), "--out"]
    faults = {
        "flipped": ({"to_board": 1200}, "to the board (arrived damaged|arrived out of order)"),
        "back": ({"to_host": 450}, "a frame from the board arrived damaged"),
        "pulled": ({"pull_after": 450}, "is gone; check the cable"),
    }
    jobs = {"clean": ([], {}), **{name: ([], line) for name, (line, _) in faults.items()}}
    jobs["raw"] = (["--raw", "--no-check"], {})  # after all faults
    words = {name: [*play, str(tmp_path / f"{name}.npz"), *own] for name, (own, _) in jobs.items()}
    said = hosts(chip, {name: {"words": words[name], **line} for name, (_, line) in jobs.items()})
    recordings = {name: Recording.load(tmp_path / f"{name}.npz") for name in jobs}
    whole = recordings["clean"].events
    assert (said["clean"]["code"], said["raw"]["code"]) == (0, 0), said
    found, verdict = said["clean"]["out"].splitlines()
    assert verdict == "events and classes equal the model's"
    assert len(whole) > 300
    assert ": c, early decision: c after 0.0009 s; " in found, "of the third bin"
    assert np.array_equal(recordings["raw"].events, whole)
    assert said["raw"]["out"].splitlines() == [found.replace("clean.npz", "raw.npz"), "not compared with the model"]
    assert said["clean"]["bytes"] < said["raw"]["bytes"] - TICKS * chip.readout.taxels
    for name, (_, sentence) in faults.items():
        kept = recordings[name].events
        assert said[name]["code"] == 2, said[name]
        assert re.search(f"^error: .*{sentence}", said[name]["err"]), said[name]
        assert said[name]["err"].count("\n") == 1
        assert 0 < len(kept) < len(whole), name
        assert np.array_equal(kept, whole[: len(kept)]), name
        assert f"{len(kept)} events received before are in" in said[name]["err"]


def test_a_foreign_chip_is_recorded_into_our_files(hosts: Hosts, tmp_path: Path) -> None:
    """Check addresses and times of the recorded events, and the count of lost events."""
    rng = random.Random(3)
    slow = [[2_000_000 + rng.randrange(5_000_000), rng.randrange(1 << 5)] for _ in range(60)]
    events = [*slow[:30], [1_400_000_000, 0], *slow[30:]]  # the time passes 2**16 clocks
    burst = [[40_000, rng.randrange(1 << 5)] for _ in range(300)]
    places = [(x, y) for x in range(3) for y in range(2)]
    lines = [f"{y + 1},{x + 1},{x},{y}" for x, y in places]  # from one on, with swapped axes
    (tmp_path / "map.csv").write_text("\n".join(["from_x,from_y,x,y", *lines]))
    of_two = [(*rng.choice(places), rng.randrange(1, 3)) for _ in range(30)]
    dual = [[5_000_000, y + 1 | x + 1 << 2, which] for x, y, which in of_two]
    jobs = [
        ("heard", events, ["--rows", "4", "--columns", "4"]),
        ("burst", burst, ["--rows", "4", "--columns", "4"]),
        ("dual", [*dual, [5_000_000, 5, 3]], ["--map", str(tmp_path / "map.csv"), "--link", "four_phase_dual"]),
    ]
    listen = {name: ["listen", *words, "--out", str(tmp_path / f"{name}.npz")] for name, _, words in jobs}
    said = hosts(None, {name: {"words": listen[name], "events": sent} for name, sent, _ in jobs})
    heard, lost = Recording.load(tmp_path / "heard.npz"), Recording.load(tmp_path / "burst.npz")
    address = heard.events["p"] * 16 + heard.events["y"] * 4 + heard.events["x"]
    assert said["heard"]["code"] == 0, said
    assert address.tolist() == [one for _, one in events]
    clocks = np.array(said["heard"]["requests"]) / (1000 * CLOCK_NS)
    late = heard.events["t"] - clocks
    assert np.ptp(late) <= 1  # only where the edge falls between two of the clock
    assert said["burst"]["code"] == 1
    assert f"LOST {300 - len(lost.events)} events" in said["burst"]["out"]
    assert 90 < len(lost.events) < 300
    two = Recording.load(tmp_path / "dual.npz")
    assert [(e["x"], e["y"], 2 - e["p"]) for e in two.events] == of_two
    assert (two.config.rows, two.config.columns, two.config.link) == (2, 3, "four_phase_dual")
    assert said["dual"]["code"] == 2, said["dual"]
    assert "requested ON and OFF at once; check the wires" in said["dual"]["err"]


# -- a skin ------------------------------------------------------------------------------------------


def test_the_classes_of_a_skin_at_the_board_need_no_samples_of_the_host(
    hosts: Hosts, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runners, "OPTIMISE", "-O0")  # compiling takes longer than the run
    readout = ReadoutConfig(rows=2, columns=3, resolution=5, clocks_per_sample=64)
    network = ClassifierConfig(inputs=12, hidden=10, classes=3, lanes=2, bin_s=0.0003)
    chip = ChipConfig(readout=readout, classifier=network)
    walk = 2048 + np.cumsum(np.random.default_rng(5).integers(-140, 141, (20, 2, 3)), axis=0)
    codes = walk.clip(0, 4095)
    np.save(tmp_path / "codes.npy", codes)
    weights = weights_of(chip, tmp_path / "weights.npz")
    words = ["play", str(weights), "--sensor", "--limit", str(len(codes)), "--out", str(tmp_path / "felt.npz")]
    skin = {"part": "ads7953", "settle_s": SETTLE_S}
    job = {"felt": {"words": words, "codes": str(tmp_path / "codes.npy"), "sensor": skin}}
    said = hosts(chip, job, SensorConfig(**skin))["felt"]  # type: ignore[arg-type]
    assert said["code"] == 0, said
    felt = Recording.load(tmp_path / "felt.npz")
    samples = samples_of("ads7953", codes, 12).reshape(len(codes), -1)
    model = simulate_chip(chip, network_of(chip), samples, felt.duration_clocks)
    assert len(felt.events) > 100
    assert np.array_equal(felt.events, as_events(model.events.tolist()))
    assert f"{len(model.classifier.bins)} bins" in said["out"]
