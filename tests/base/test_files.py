"""Test readers of JSON, which name file and error, and the age of compiled loops."""

import os
from pathlib import Path

import pytest

from eskin.base.errors import InputError
from eskin.base.files import forget_stale_kernels, read_arrays, read_bytes, read_json


@pytest.mark.parametrize(
    ("text", "kind", "sentence"),
    [
        ("{", None, "the sweep a.json is not JSON: Expecting property name"),
        (b"\xff\xfe{", None, "the sweep a.json is not JSON: "),
        ("[" * 100_000, None, "the sweep a.json cannot be read as JSON: it is nested too deeply"),
        ("[1]", dict, "the sweep a.json must be a JSON object, not list"),
        ("{}", list, "the sweep a.json must be a JSON list, not dict"),
        (None, None, "cannot read the sweep a.json: No such file or directory"),
    ],
)
def test_a_file_that_is_not_what_it_should_be_gets_one_sentence(tmp_path, monkeypatch, text, kind, sentence):
    monkeypatch.chdir(tmp_path)
    path = (tmp_path / "a.json").relative_to(tmp_path)
    if text is not None:
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError) as refused:
        read_json(path, "the sweep", kind)
    assert str(refused.value).startswith(sentence)


def test_a_json_file_is_read_as_written(tmp_path):
    (tmp_path / "a.json").write_text('{"a": [1, 2.5, null]}')
    assert read_json(tmp_path / "a.json", "the sweep", dict) == {"a": [1, 2.5, None]}


def test_a_device_that_never_ends_is_no_json() -> None:
    with pytest.raises(InputError, match="/dev/zero is a device; give a file"):
        read_json(Path("/dev/zero"), "the configuration")


def test_kernels_older_than_a_step_are_compiled_again(tmp_path: Path) -> None:
    loop, step, cache = tmp_path / "loop.py", tmp_path / "step.py", tmp_path / "__pycache__"
    cache.mkdir()
    kernels = [cache / name for name in ("loop.run-1.py311.nbi", "loop.run-1.py311.1.nbc", "other.run-1.py311.nbi")]
    for number, path in enumerate((loop, step, *kernels)):
        path.touch()
        os.utime(path, (1000 + number, 1000 + number))
    forget_stale_kernels(loop, [step])
    assert all(path.exists() for path in kernels)
    os.utime(step, (2000, 2000))
    forget_stale_kernels(loop, [loop, step])
    assert [path.exists() for path in kernels] == [False, False, True]


def test_an_input_that_may_never_end_is_refused(tmp_path: Path) -> None:
    (tmp_path / "z.npz").symlink_to("/dev/zero")
    os.mkfifo(tmp_path / "f.npz")
    handle = os.open(tmp_path / "f.npz", os.O_RDWR)  # a writer that writes nothing
    for name, what in (("z", "a device"), ("f", "a FIFO")):
        path = tmp_path / f"{name}.npz"
        for read in (lambda path: read_bytes(path, "it"), lambda path: read_arrays(path, "a file", "again")):
            with pytest.raises(InputError, match=f"{name}.npz is {what}; give a file$"):
                read(path)
    os.close(handle)
    reader, writer = os.pipe()
    os.write(writer, b"text")
    os.close(writer)
    assert read_bytes(Path(f"/dev/fd/{reader}"), "it") == b"text"
    os.close(reader)
