"""Test that a compiled loop is recompiled after a change of a function that it calls."""

from __future__ import annotations

import os
from pathlib import Path

from eskin.base.files import forget_stale_kernels


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
