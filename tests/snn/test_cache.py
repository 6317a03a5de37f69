"""Test the cache of scans, and its protection against files of other users."""

import ctypes
import dataclasses
import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eskin.base import cache as place
from eskin.model.config import ReadoutConfig
from eskin.skin.textures.dataset import Dataset, embedded_dataset
from eskin.skin.textures.paper import PaperScan
from eskin.skin.textures.physical import PhysicalScan
from eskin.snn.data import cache
from eskin.snn.data.bins import BinConfig
from eskin.snn.data.frame_steps import FrameSteps
from eskin.snn.data.scans import ScanData
from eskin.snn.experiments.experiment import Experiment
from eskin.snn.kernels import cpu
from tests.snn.helpers import easy_data, few_textures


@pytest.fixture(autouse=True)
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the empty cache folder."""
    monkeypatch.setenv("ESKIN_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache" / "scans"


def same(a: ScanData, b: ScanData) -> bool:
    pairs = zip(vars(a).values(), vars(b).values(), strict=True)
    return all(np.array_equal(x, y) and np.asarray(x).dtype == np.asarray(y).dtype for x, y in pairs)


@pytest.mark.parametrize(
    "fields", [{}, {"frames": FrameSteps(frames_per_step=20), "network": {"kind": "rnn"}}], ids=["events", "frames"]
)
def test_the_second_time_nothing_is_recorded_and_the_scans_are_the_same(
    fields: dict[str, object], kept: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    few_textures(monkeypatch)
    small = ReadoutConfig(rows=1, columns=2, resolution=4)
    experiment = Experiment(dataset="embedded", readout=small, **fields)  # type: ignore[arg-type]
    first = experiment.data()
    monkeypatch.setattr("eskin.snn.experiments.experiment.record_dataset", lambda *_: pytest.fail("recorded again"))
    monkeypatch.setattr("eskin.snn.experiments.experiment.frame_dataset", lambda *_: pytest.fail("framed again"))
    assert same(experiment.data(), first)
    assert len(list(kept.glob("*.npz"))) == 1
    assert first.values.any()


def test_the_name_of_an_entry_is_made_of_all_that_makes_it(tmp_path: Path) -> None:
    textures = embedded_dataset().limit(2)
    config = ReadoutConfig()
    names = {cache.key_of(textures, PhysicalScan(), config, BinConfig(), [0.0])}
    assert names == {cache.key_of(textures, PhysicalScan(), config, BinConfig(), [0.0])}
    for other in (
        (textures, PhysicalScan(speed_m_per_s=0.06), config, BinConfig(), [0.0]),
        (textures, PaperScan(), config, BinConfig(), [0.0]),
        (textures, PhysicalScan(), config.replace(resolution=5), BinConfig(), [0.0]),
        (textures, PhysicalScan(), config, BinConfig(bin_s=0.002), [0.0]),
        (textures, PhysicalScan(), config, FrameSteps(), [0.0]),
        (textures, PhysicalScan(), config, BinConfig(), [0.0, 1.0]),
        (embedded_dataset().limit(3), PhysicalScan(), config, BinConfig(), [0.0]),
    ):
        names.add(cache.key_of(*other))  # type: ignore[arg-type]
    path = tmp_path / "a.png"
    shutil.copy(textures[0].path, path)
    moved = Dataset("embedded", textures.class_names, (dataclasses.replace(textures[0], path=path), textures[1]))
    assert cache.key_of(moved, PhysicalScan(), config, BinConfig(), [0.0]) in names, "the bytes count, not the place"
    path.write_bytes(path.read_bytes() + b"\0")
    os.utime(path, ns=(1, 1))
    names.add(cache.key_of(moved, PhysicalScan(), config, BinConfig(), [0.0]))
    assert len(names) == 9


def test_a_source_of_the_model_that_changes_makes_another_name(monkeypatch: pytest.MonkeyPatch) -> None:
    arguments = (embedded_dataset().limit(1), PhysicalScan(), ReadoutConfig(), BinConfig(), [0.0])
    before = cache.key_of(*arguments)
    cache._computed_by.cache_clear()
    original = Path.read_bytes
    monkeypatch.setattr(Path, "read_bytes", lambda self: original(self) + b"#" * (self.name == "taxel.py"))
    after = cache.key_of(*arguments)
    cache._computed_by.cache_clear()
    assert after != before


def test_a_damaged_entry_is_made_again(kept: Path) -> None:
    data = easy_data()
    assert same(cache.kept("a", lambda: data), data)
    whole = (kept / "a.npz").read_bytes()
    middle = len(whole) // 2
    for bad in (b"", whole[:middle], whole[:middle] + bytes([whole[middle] ^ 255]) + whole[middle + 1 :], b"PK"):
        (kept / "a.npz").write_bytes(bad)
        made: list[int] = []
        assert same(cache.kept("a", lambda made=made: made.append(1) or data), data)  # type: ignore[misc]
        assert made == [1]
        assert same(cache.kept("a", lambda: pytest.fail("kept wrongly")), data)


def test_the_entries_used_longest_ago_go_first(kept: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data = easy_data()
    for number, name in enumerate("abc"):
        cache.kept(name, lambda: data)
        os.utime(kept / f"{name}.npz", (number, number))
    size = (kept / "a.npz").stat().st_size
    cache.kept("a", lambda: data)  # used now
    monkeypatch.setattr(cache, "LIMIT_BYTES", 2 * size)
    cache.kept("d", lambda: data)
    assert {path.name for path in kept.glob("*.npz")} == {"a.npz", "d.npz"}
    for name in (".x.npz.1.part", "mine.txt"):
        (kept / name).write_bytes(b"half")
        os.utime(kept / name, (0, 0))
    cache.kept("e", lambda: data)
    left = {path.name for path in kept.glob("*")}
    assert left == {"d.npz", "e.npz", "mine.txt"}, "what a killed writer left is gone, other files stay"


@pytest.mark.command("cache")
def test_the_command_shows_and_clears(kept: Path, eskin: Any) -> None:
    cache.kept("a", easy_data)
    assert eskin("cache")[0] == f"{kept.parent}: 1 recorded scans, 0.0 MB of at most 1074 MB\n"
    assert eskin("cache --clear")[0].startswith("removed 1 recorded scans")
    assert not list(kept.iterdir())


def test_a_folder_that_others_can_write_to_or_a_link_is_not_believed(
    kept: Path, tmp_path: Path, eskin: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    cache.kept("a", easy_data)
    (kept / "a.npz").chmod(0o666)
    made: list[int] = []
    cache.kept("a", lambda: made.append(1) or easy_data())  # type: ignore[func-returns-value]
    assert made == [1]
    (tmp_path / "other").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "other")
    monkeypatch.setenv("ESKIN_CACHE", str(tmp_path / "link"))
    assert place.usable() is None
    assert "the folder is not used: it cannot be written" in eskin("cache")[0]
    monkeypatch.setenv("ESKIN_CACHE", str(tmp_path / "mine"))
    monkeypatch.setattr(os, "getuid", lambda: 123456)
    assert place.usable() is None, "it is another user's"
    assert same(cache.kept("a", easy_data), easy_data())


@pytest.mark.skipif(shutil.which("g++") is None, reason="no compiler")
def test_a_library_that_was_planted_is_not_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = 'extern "C" void kernel_keep_memory() {}\n'
    (tmp_path / "kernel.cpp").write_text(source)
    trap = f'__attribute__((constructor)) static void run() {{ fopen("{tmp_path}/sprung", "w"); }}\n'
    (tmp_path / "evil.cpp").write_text(f"#include <cstdio>\n{source}{trap}")
    subprocess.run(["g++", "-shared", "-fPIC", "evil.cpp", "-o", "evil.so"], cwd=tmp_path, check=True)
    monkeypatch.setattr(cpu, "SOURCE", tmp_path / "kernel.cpp")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))

    def load(**places: str) -> None:
        for name, value in places.items():
            monkeypatch.setenv(name, value)
        assert cpu._library.__wrapped__() is not None
        assert not (tmp_path / "sprung").exists()

    load(ESKIN_CACHE=str(tmp_path / "good"))
    (library,) = (tmp_path / "good").glob("kernel-*.so")
    for folder in ("shared", f"tmp/spiking-eskin-readout-{os.getuid()}"):
        (tmp_path / folder).mkdir(parents=True)
        shutil.copy(tmp_path / "evil.so", tmp_path / folder / library.name)
    planted = tmp_path / "shared" / library.name
    planted.chmod(0o666)
    load(ESKIN_CACHE=str(tmp_path / "shared"))
    assert planted.stat().st_mode & 0o777 == 0o700
    load(ESKIN_CACHE="", XDG_CACHE_HOME=str(tmp_path / "kernel.cpp"))  # no folder can be there
    ctypes.CDLL(str(tmp_path / "evil.so"))
    assert (tmp_path / "sprung").exists(), "the trap works"
