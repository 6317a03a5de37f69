"""Test output paths: links, devices and FIFOs, and protection of the user's files."""

import os
import signal
import stat
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from eskin.base.errors import InputError
from eskin.base.files import atomic_write
from eskin.base.outputs import check_folder, file_of, has_earlier
from eskin.verify.proofs.run import earlier

KILLED = """
import os, signal, sys
from pathlib import Path
from eskin.base.files import atomic_write
with atomic_write(Path(sys.argv[1])) as file:
    file.write(b"half")
    file.flush()
    print("writing", flush=True)
    sys.stdin.read(1)
"""


def write(path: Path, content: bytes = b"new") -> None:
    with atomic_write(file_of(path)) as file:
        file.write(content)


def test_a_link_gets_its_target_written(tmp_path: Path) -> None:
    target, link, dangling = tmp_path / "a" / "target", tmp_path / "link", tmp_path / "dangling"
    target.parent.mkdir()
    target.write_text("old")
    link.symlink_to("a/target")
    dangling.symlink_to(link.name)
    link.with_name("new").symlink_to("a/new")
    write(dangling)
    write(tmp_path / "new")
    assert (link.is_symlink(), dangling.is_symlink()) == (True, True)
    assert [path.read_text() for path in (target, target.with_name("new"))] == ["new", "new"]
    (tmp_path / "ring").symlink_to("ring")
    with pytest.raises(InputError, match=r"cannot write .*ring: (it is a link to itself|Too many levels)"):
        write(tmp_path / "ring")


def test_devices_and_fifos_are_written_to_and_stay(tmp_path: Path) -> None:
    for fifo in (tmp_path / "fifo", tmp_path / "link"):
        got: list[bytes] = []
        if not (tmp_path / "fifo").exists():
            os.mkfifo(fifo)
            (tmp_path / "link").symlink_to("fifo")
        reader = threading.Thread(target=lambda fifo=fifo, got=got: got.append(fifo.read_bytes()))
        reader.start()
        write(fifo, b"x" * 100_000)
        reader.join()
        assert got == [b"x" * 100_000]
        assert stat.S_ISFIFO((tmp_path / "fifo").stat().st_mode)
    write(Path("/dev/null"))
    with pytest.raises(InputError, match=r"^cannot write /dev/full: No space left on device$"):
        write(Path("/dev/full"))
    assert stat.S_ISCHR(os.stat("/dev/full").st_mode)
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)


def test_earlier_results_are_looked_for_in_files_only(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    write(tmp_path / "file")
    places = (tmp_path / "file", tmp_path / "fifo", Path("/dev/full"), tmp_path / "none", None)
    assert [has_earlier(place) for place in places] == [True, False, False, False, False]
    assert earlier(Path("/dev/full")) == {}


def test_a_failure_writes_nothing_to_a_stream(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    with pytest.raises(ZeroDivisionError), atomic_write(tmp_path / "fifo"):  # would wait for a reader
        _ = 1 // 0


def test_files_of_a_killed_writer_are_removed_and_of_a_running_writer_kept(tmp_path: Path) -> None:
    path = tmp_path / "[rec].npz"
    killed, living = (
        subprocess.Popen([sys.executable, "-c", KILLED, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        for _ in range(2)
    )
    for process in (killed, living):
        assert process.stdout is not None
        assert process.stdout.readline() == b"writing\n"
    killed.send_signal(signal.SIGKILL)
    killed.wait()
    (tmp_path / ".other.npz.abcdefgh.part").write_text("of another file")
    assert len(list(tmp_path.iterdir())) == 3
    write(path)
    assert len(list(tmp_path.glob(".[[]rec*.part"))) == 1
    living.communicate(b"x")
    assert path.read_bytes() == b"half"
    assert sorted(entry.name for entry in tmp_path.iterdir()) == [".other.npz.abcdefgh.part", "[rec].npz"]


@pytest.mark.parametrize(
    ("check", "name", "sentence"),
    [
        (file_of, "folder", "cannot write .*folder: it is a folder; give the name of a file"),
        (file_of, "nothing/x", "cannot write .*x: the folder .*nothing does not exist; create it first"),
        (file_of, "file/x", "cannot write .*x: the folder .*file does not exist; create it first"),
        (file_of, "x" * 256, "cannot write x{40}...: the name has more than 255 bytes; shorten it"),
        (file_of, "/proc/x", "cannot write /proc/x: No such file or directory in /proc"),
        (check_folder, "file", "cannot write to .*file: it is a file; give the name of a folder"),
        (check_folder, "file/a/b", "cannot write to .*b: .*file is a file; give a folder in another place"),
        (check_folder, "link/a", "cannot write to .*a: .*link is a link to nowhere, which does not exist"),
        (check_folder, "a/" + "x" * 256, "cannot write x{40}...: the name has more than 255 bytes; shorten it"),
        (check_folder, "/proc/x/y", "cannot write /proc/x/y: No such file or directory in /proc"),
    ],
)
def test_a_path_that_is_no_output(tmp_path: Path, check: Callable[[Path], object], name: str, sentence: str) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").touch()
    (tmp_path / "link").symlink_to("nowhere")
    with pytest.raises(InputError, match=rf"^{sentence}$"):
        check(tmp_path / name)
    check_folder(tmp_path / "a" / "b")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "folder", "link"]


def test_a_new_file_has_usual_permissions_and_any_name_that_a_file_system_takes(tmp_path: Path) -> None:
    (tmp_path / "plain").touch()
    for name in ("x" * 255, "é" * 127):
        write(tmp_path / name)
        assert (tmp_path / name).read_bytes() == b"new"
        assert (tmp_path / name).stat().st_mode == (tmp_path / "plain").stat().st_mode
