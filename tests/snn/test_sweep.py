"""Test that a sweep gives equal files in parallel, in series and after a restart, and rejects invalid input."""

import itertools
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import distributed
import pytest

from eskin.app.commands.learn.sweep import _print_table
from eskin.app.options import LEAKY
from eskin.base.errors import InputError
from eskin.base.workers import engine
from eskin.base.workers.engine import Cluster, Local
from eskin.base.workers.store import Store, store_of
from eskin.model.config import ReadoutConfig
from eskin.model.encoders import registry
from eskin.snn.data.frame_steps import FrameSteps
from eskin.snn.data.scans import ScanData
from eskin.snn.experiments import crossval
from eskin.snn.experiments.experiment import Experiment
from eskin.snn.experiments.pairs import compare
from eskin.snn.experiments.points import READINGS, as_word, load_sweep
from eskin.snn.experiments.settings import parse_points
from eskin.snn.experiments.sweep import NEEDS, PointRun, SweepPoint, sweep
from eskin.snn.training import TrainConfig
from tests.snn.helpers import easy_data

ENCODERS = ", ".join(registry.NAMES)

ROOT = Path(__file__).parents[2]


def points(epochs: int = 2, **data: Any) -> list[SweepPoint]:
    """Return two sweep points with tiny networks."""
    made = []
    for hidden in (16, 12):
        network = {"hidden": hidden, "readout": "membrane", "dropout": 0.3}
        experiment = Experiment(network=network, train=TrainConfig(epochs=epochs, batch=8))
        made.append(SweepPoint(f"hidden-{hidden}", experiment, easy_data(**data)))
    return made


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*.json")}


@pytest.mark.quick
def test_only_missing_cells_are_run_and_every_prediction_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ran: list[tuple[int, int, int]] = []
    original = crossval.run_cell

    def noted(experiment: Experiment, data: ScanData, fold: int, seed: int, *rest: int) -> dict[str, Any]:
        ran.append((experiment.network["hidden"], fold, seed))
        return original(experiment, data, fold, seed, *rest)

    monkeypatch.setattr(crossval, "run_cell", noted)
    seen: list[tuple[int, int]] = []

    def progress(_: PointRun, result: dict[str, Any] | None) -> None:
        if result is not None:
            found = json.loads((tmp_path / "sweep.json").read_text())["points"]
            seen.append((found[0]["cells"]["done"], found[0]["cells"]["whole_seeds"]))
            assert (found[0]["last"] is None) == (found[0]["cells"]["whole_seeds"] == 0)
            assert (tmp_path / "hidden-16" / "result.json").exists() == (found[0]["cells"]["done"] == 4)

    data = easy_data()
    sweep(points(), tmp_path, pool=Local(1), folds=2, seeds=2, progress=progress)
    assert ran == [(hidden, fold, seed) for seed in (0, 1) for hidden in (16, 12) for fold in (0, 1)]
    assert seen == [(1, 0), (2, 1), (2, 1), (2, 1), (3, 1), (4, 2), (4, 2), (4, 2)]
    whole = files(tmp_path)
    ran.clear()
    kept = store_of(tmp_path / "sweep.json")
    lines = [line for line in kept.read_text().splitlines() if line]
    kept.write_text("\n".join([*lines[:3], lines[3][:-9], *lines[4:], ""]))  # a crash while a line was written
    sweep(points(), tmp_path, pool=Local(1), folds=2, seeds=2)
    assert ran == [(12, 1, 0)]
    assert files(tmp_path) == whole

    (first, _) = load_sweep(tmp_path).points
    found = json.loads((tmp_path / "hidden-16" / "result.json").read_text())["cells"]
    cells = {(cell["fold"], cell["seed"]): cell for cell in found}
    assert first["labels"] == as_word(data.image_labels)
    for reading, (fold, seed) in itertools.product(READINGS, itertools.product(range(2), range(2))):
        cell = cells[fold, seed]
        word = first[reading]["predictions"][seed]
        assert [int(word[image]) for image in cell["test_images"]] == cell[reading]


def test_two_points_are_compared_image_by_image() -> None:
    found = compare("00112", ["00110", "00000"], ["10112", "00112", "00112"])
    assert (found.only_first, found.only_second) == ([1, 0], [1, 3]), "seeds that one alone has do not count"
    assert found.p == [1.0, pytest.approx(0.25)]
    assert (found.accuracy_first, found.accuracy_second) == ([0.8, 0.4], [0.8, 1.0])
    assert found.difference == pytest.approx(0.3)
    assert found.interval[0] < 0.3 < found.interval[1]
    seeds = compare("00112", ["00112", "11221"], ["00112", "00112"])
    assert seeds.interval == (0.0, 1.0), "every image gains the same, so that the interval is all of the seeds"
    same = compare("00112", ["00110"], ["00110"])
    assert (same.difference, same.interval, same.p) == (0.0, (0.0, 0.0), [1.0])


def test_a_cell_that_diverges_is_named_and_the_others_are_kept(tmp_path: Path) -> None:
    good, other = points()
    bad = Experiment(network=other.experiment.network | {"output_scale": 1e38}, train=other.experiment.train)
    message = r"^point bad, fold 0, seed 0: the training diverged in epoch 1: .*$"
    with pytest.raises(InputError, match=message):
        sweep([good, SweepPoint("bad", bad, easy_data())], tmp_path, pool=Local(1), folds=2, seeds=1)
    assert json.loads((tmp_path / "sweep.json").read_text())["points"][0]["cells"]["done"] == 2
    assert (tmp_path / "hidden-16" / "result.json").exists()


def test_cells_of_other_scans_another_experiment_or_other_code_are_run_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def trained(made: list[SweepPoint]) -> int:
        ran: list[Any] = []
        sweep(made[:1], tmp_path, pool=Local(1), folds=2, seeds=1, progress=lambda _, result: ran.append(result))
        return len(ran) - ran.count(None)

    assert [trained(points()), trained(points())] == [2, 0]
    assert [trained(points(epochs=3)), trained(points(steps=14)), trained(points())] == [2, 2, 0]
    monkeypatch.setattr("eskin.snn.experiments.sweep.version", lambda _: "1.0")
    assert trained(points()) == 2


def test_rates_of_the_summary_by_hand(tmp_path: Path) -> None:
    def summary(experiment: Experiment) -> dict[str, Any]:
        run = PointRun(SweepPoint("x", experiment, easy_data()), tmp_path, 2, 1, Store(None, ""))
        assert run.summary()["normalised_rate"] is None
        run.prepare(lambda: None)
        return run.summary()

    lcs = summary(Experiment(readout=ReadoutConfig(encoding="lcs", resolution=4)))  # easy_data: 1000 events/s
    assert (lcs["readout"], lcs["resolution"], lcs["preset"], lcs["bits_per_event"]) == ("lcs", 4, "physical", 7)
    assert lcs["data_rate_bps"] == 7000
    assert lcs["normalised_rate"] == pytest.approx(7000 / 640_000)
    assert summary(Experiment(readout=ReadoutConfig(encoding="nlcs", resolution=6)))["bits_per_event"] == 6
    assert summary(Experiment(readout=ReadoutConfig(resolution=4), variant="on"))["bits_per_event"] == 6
    bipolar = Experiment(readout=ReadoutConfig(encoding="nlcs-bipolar", resolution=4))
    assert summary(bipolar)["bits_per_event"] == 7
    frame = summary(Experiment(frames=FrameSteps(frames_per_step=5), network={"kind": "rnn"}))
    assert (frame["readout"], frame["resolution"], frame["data_rate_bps"]) == ("frame", 10, 10_000)


def command(folder: Path) -> list[str]:
    """Return the options of a small sweep over the embedded textures."""
    (folder / "small.json").write_text(json.dumps({"rows": 1, "columns": 2}))
    options = ["sweep", "--dataset", "embedded", "--config", str(folder / "small.json"), "--bin", "0.01"]
    return [*options, "--points", "lcs:4,rnn:100", "--set", "hidden=16", "--folds", "2", "--seeds", "2"]


def test_a_killed_sweep_goes_on_and_ends_in_the_same_files(tmp_path: Path, eskin: Any) -> None:
    options = [*command(tmp_path), "--epochs", "2"]
    arguments = [sys.executable, "-m", "eskin", *options, "--workers", "2", "--out", str(tmp_path / "killed")]
    kept = store_of(tmp_path / "killed" / "sweep.json")
    killed = subprocess.Popen(arguments, cwd=ROOT, start_new_session=True, stdout=subprocess.DEVNULL)
    try:
        deadline = time.monotonic() + 120
        while not kept.exists() or kept.read_bytes().count(b"seal") < 2:
            assert killed.poll() is None, "it ended before it could be killed"
            assert time.monotonic() < deadline
            time.sleep(0.005)
    finally:
        os.killpg(killed.pid, signal.SIGKILL)
        killed.wait()
    before = kept.read_bytes()
    assert 2 <= before.count(b"seal") < 8
    for name in ("killed", "whole"):
        out, _ = eskin(*options, "--workers 1 --out", tmp_path / name)
    assert kept.read_bytes().startswith(before)
    assert kept.read_bytes().count(b"seal") <= 9, "one line may be cut"
    assert files(tmp_path / "killed") == files(tmp_path / "whole")
    assert "rnn-100" in out
    summary = json.loads((tmp_path / "whole" / "sweep.json").read_text())
    assert summary["command"] == (
        f"eskin sweep --points lcs:4,rnn:100 --config {tmp_path}/small.json --dataset embedded --epochs 2 "
        f"--bin 0.01 --set hidden=16 --folds 2 --seeds 2"
    )
    assert [point["cells"] for point in summary["points"]] == [{"done": 4, "of": 4, "whole_seeds": 2}] * 2
    frame = json.loads((tmp_path / "whole" / "rnn-100" / "result.json").read_text())
    assert frame["experiment"]["network"] == {"kind": "rnn", "input_rms": 1.0, "input_center": True, "hidden": 16}


@pytest.mark.command("sweep")
@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--points lcs", f"a point must be ENCODER:RESOLUTION (encoders: {ENCODERS}), frame|"),
        ("--points lcs:4,,nlcs:6", "a point must be ENCODER:RESOLUTION"),
        ("--points ann:4", "a point must be ENCODER:RESOLUTION"),
        ("--points lcs:4,lcs:04", "--points has lcs:4 twice; leave one out"),
        ("--points lcs:4:on,lcs:04:on", "--points has lcs:4:on twice; leave one out"),
        ("--points nlcs:4:on", "a point must be ENCODER:RESOLUTION"),
        ("--points lcs:99", "point lcs:99: resolution must be"),
        ("--points rnn:0", "point rnn:0: frames_per_step must be at least 1, not 0"),
        (
            "--points lcs:4 --tau 0.1",
            "--tau is the leak of {0}, but --points has no {0} point; leave it out".format(" or ".join(LEAKY)),
        ),
        ("--points frame:250", "point frame:250: frames need KIND:RATE:BITS"),
        (
            "--points gru:20 --bin 0.004",
            "--bin has no effect on rnn|gru|cnn:K, where K is the number of frames per step",
        ),
        (
            "--points rnn:20,gru:20 --set decay=0.5",
            "--set decay has no effect on any network of these points; leave it",
        ),
        ("--workers 2 --scheduler tcp://a:1", "--workers starts processes on this machine"),
    ],
)
def test_bad_options_get_one_sentence(options: str, message: str, refuses: Any) -> None:
    refuses(f"error: {message}", "sweep --dataset embedded --out out", options)


def test_a_setting_that_some_points_do_not_have_is_said(eskin: Any) -> None:
    options = "--set decay=0.5 --workers 2 --scheduler tcp://a:1"  # the scheduler beside workers is refused after that
    _, error = eskin("sweep --dataset embedded --out out --points lcs:4,rnn:20,gru:20", options, code=2)
    note, _ = error.splitlines()
    assert note == "note: --set decay has no effect on the network of rnn-20, gru-20"


def test_the_table_has_the_interval_over_images_and_seeds(capsys: pytest.CaptureFixture[str]) -> None:
    last = {"accuracy": 0.8, "sd_over_cells": 0.157, "bootstrap_95": [0.612, 0.934]}
    point = {"name": "lcs-6", "normalised_rate": 1.085, "last": last, "selected": last | {"accuracy": 0.7}}
    _print_table([point])
    title, row = capsys.readouterr().out.split("point")
    assert "95 % interval over images and seeds; sd over cells" in " ".join(title.split())
    assert row.splitlines()[-2].split() == ["lcs-6", "1.08", "80.0", "61.2", "to", "93.4", "15.7", "70.0", "15.7"]


def test_a_summary_that_cannot_be_written_is_refused_before_the_scans(tmp_path: Path) -> None:
    (tmp_path / "sweep.json").mkdir()
    with pytest.raises(InputError, match=r"sweep\.json: it is a folder"):
        sweep(points(), tmp_path, pool=Local(1), folds=2, seeds=1, progress=lambda *_: pytest.fail("it began"))


def test_as_many_processes_as_cores_that_may_be_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {3}, raising=False)
    assert Local().window == 1


def test_points_are_encoder_and_number() -> None:
    assert parse_points("lcs:2, cw-lcs:04,gru:20,frame-diff:62.5:8") == [
        ("lcs", "2"),
        ("cw-lcs", "4"),
        ("gru", "20"),
        ("frame-diff", "62.5:8"),
    ]
    assert parse_points("lcs:6:on,nlcs-bipolar:04") == [("lcs", "6:on"), ("nlcs-bipolar", "4")]


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nonsense://x", "tcp://127.0.0.1:port", "tcp:///"])
def test_a_scheduler_that_is_not_there_gets_one_sentence(
    address: str, eskin: Any, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engine, "CONNECT_S", 1.0)
    began = time.monotonic()
    _, error = eskin(*command(folder), "--out out --scheduler", address, code=2)
    assert time.monotonic() - began < 25  # a client of Dask would try for 30 s
    assert error == (
        f"error: no Dask scheduler answers at {address}; start one with dask scheduler and give its address, "
        f"as --scheduler tcp://HOST:8786\n"
    )


def start_worker(scheduler: str, number: int) -> subprocess.Popen[bytes]:
    options = ["--nthreads", "1", "--no-nanny", "--name", str(number), "--no-dashboard"]
    command = [sys.executable, "-m", "distributed.cli.dask_worker", scheduler, *options]
    return subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    """Yield the address of a Dask scheduler without workers."""
    with distributed.LocalCluster(n_workers=0, host="127.0.0.1", dashboard_address=None) as cluster:
        yield cluster.scheduler_address


@pytest.fixture
def cluster(scheduler: str) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """Yield the address of a Dask scheduler with two workers."""
    made = [start_worker(scheduler, number) for number in range(2)]
    try:
        yield scheduler, made
    finally:
        for process in made:
            process.kill()
            process.wait()


def test_a_scheduler_without_workers_is_refused(scheduler: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "WORKERS_S", 0.3)
    with pytest.raises(InputError, match=r"has no workers; start some with dask worker tcp://.* --nthreads 1"):
        Cluster(scheduler, NEEDS)


def test_a_sweep_outlives_its_workers_and_ends_in_the_files_of_a_serial_one(
    cluster: tuple[str, list[subprocess.Popen[bytes]]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    address, processes = cluster
    monkeypatch.setattr(engine, "WORKERS_S", 60.0)
    slow = {"epochs": 10, "steps": 40}
    killed: list[Any] = []
    with Cluster(address, NEEDS) as pool:
        client = pool._client
        client.wait_for_workers(2, timeout=60)

        def kill(_: PointRun, result: dict[str, Any] | None) -> None:
            """Kill both workers during trainings, once, and start a third one."""
            if result is None or killed:
                return
            busy = {where for where, tasks in client.processing().items() if any("work" in key for key in tasks)}
            killed.extend(client.scheduler_info()["workers"][where]["name"] for where in busy)
            for process in processes:
                process.kill()
                process.wait()
            processes.append(start_worker(address, 2))

        sweep(points(**slow), tmp_path / "cluster", pool=pool, folds=2, seeds=2, progress=kill)
        assert killed, "no worker ran a cell when it was killed"
        (loaded,) = client.run(lambda: set(sys.modules)).values()
        assert "eskin.snn.kernels.layer" in loaded
        assert loaded.isdisjoint({"torch._dynamo", "triton"}), "compilers, which take longer to load than torch"
        assert not pool._shared
    sweep(points(**slow), tmp_path / "serial", pool=Local(1), folds=2, seeds=2)
    assert files(tmp_path / "cluster") == files(tmp_path / "serial")

    monkeypatch.setattr(engine, "version", lambda _: "1.0")
    with pytest.raises(
        InputError, match=r"^worker tcp://\S+ has a different version .*; here 1\.0\); install the same"
    ):
        Cluster(address, NEEDS)
