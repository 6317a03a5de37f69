"""Test an installation by pip: every command runs from any folder."""

import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from eskin.app.catalogue import COMMANDS
from eskin.cocotb_tests.runner.build_cache import locked
from tests.test_layers import ROOMS

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    run = tmp_path_factory.getbasetemp()
    folder = (run.parent if "PYTEST_XDIST_WORKER" in os.environ else run) / "wheel"
    folder.mkdir(exist_ok=True)
    with locked(folder):  # workers share the wheel, and what Numba compiles in it
        if not (folder / "site").exists():
            build(folder)
    return folder / "site"


def build(folder: Path) -> None:
    """Build the wheel from a copy of the sources, and unpack it into ``site``."""
    sources = folder / "sources"
    for name in ("eskin", "cocotbext-aer", *ROOMS):
        shutil.copytree(ROOT / name, sources / name, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, sources / name)
    options = ["--no-deps", "--no-build-isolation", "--disable-pip-version-check", "-q", "-w", str(folder)]
    subprocess.run([sys.executable, "-m", "pip", "wheel", *options, str(sources)], check=True, cwd=folder)
    with zipfile.ZipFile(next(folder.glob("*.whl"))) as wheel:
        wheel.extractall(folder / "unpacked")
    shutil.rmtree(sources)
    (folder / "unpacked").rename(folder / "site")


def run(installed: Path, folder: Path, *words: str) -> str:
    """Run Python in an empty folder with the wheel first in the path; return standard output."""
    outer = {k: v for k, v in os.environ.items() if not k.startswith(("ESKIN", "MAKE"))}
    environment = outer | {"PYTHONPATH": str(installed), "COLUMNS": "120"}
    # The model is compiled anew for these short runs, which takes longer than they do; at 0 Numba keeps nothing of it.
    environment["NUMBA_OPT"] = "1"
    done = subprocess.run([sys.executable, *words], cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, f"{words}: {done.stderr[-2000:]}"
    return done.stdout


def files(folder: Path) -> set[str]:
    """Return the files below a folder, without compiled caches."""
    return {str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file() and "__pycache__" not in p.parts}


def test_every_file_of_the_packages_is_in_the_wheel(installed: Path) -> None:
    wanted = {f"eskin/{name}/{path}" for name in ROOMS for path in files(ROOT / name)} | {"eskin/api.py"}
    assert {path for path in wanted if path.endswith((".json", ".html", ".v", ".cpp"))}
    assert wanted <= files(installed)
    beside = {path.name: path for path in installed.iterdir() if path.name != "eskin"}
    assert beside.pop("cocotbext").is_dir()  # the shared name of cocotb's extensions; nothing else lies beside them
    (metadata,) = beside.values()
    assert metadata.suffix == ".dist-info"
    assert "eskin = eskin.app.__main__:main" in (metadata / "entry_points.txt").read_text()


def test_every_command_is_there_elsewhere(installed: Path, tmp_path: Path) -> None:
    program = (
        "import eskin; from eskin.app.cli import COMMANDS, Commands\n"
        "print(eskin.__file__, *(name for name in COMMANDS if Commands(COMMANDS)[name].params))"
    )
    place, *names = run(installed, tmp_path, "-c", program).split()
    assert place.startswith(str(installed))
    assert names == [*COMMANDS]


def test_commands_work_elsewhere_and_write_nothing_beside_the_sources(installed: Path, tmp_path: Path) -> None:
    before = files(installed)
    (tmp_path / "skin.csv").write_text("".join(f"0.{n % 9},0.1\n" for n in range(50)))
    (tmp_path / "runs" / "skin").mkdir(parents=True)
    (tmp_path / "runs" / "skin" / "model.npz").symlink_to("rtl.npz")
    for line in (
        "verilog --rows 1 --columns 2 -o chip",
        "encode skin.csv --rows 1 --columns 2 --sample-rate 1000 -o runs/skin/rtl.npz",
        "explore",
        "convert runs/skin/rtl.npz -o skin.nir",
    ):
        run(installed, tmp_path, "-m", "eskin", *line.split())
    assert json.loads(run(installed, tmp_path, "-m", "eskin", "power", "--mode", "consistent", "--json"))
    assert {"chip/eskin_readout.v", "skin.nir", "out/explore.png"} <= files(tmp_path)
    assert files(installed) == before


@pytest.mark.skipif(shutil.which("iverilog") is None, reason="Icarus Verilog is not installed")
def test_co_simulation_builds_in_the_users_own_cache(installed: Path, tmp_path: Path) -> None:
    before = files(installed)
    line = "-m eskin sim --rows 1 --columns 2 --encoding lcs --sim icarus --textures 0"
    last = run(installed, tmp_path, *line.split()).splitlines()[-1]
    assert last.startswith("bit-exact: 9 runs, ")
    assert not (tmp_path / "build").exists()
    assert (tmp_path / "out" / "sim").is_dir()
    assert files(installed) == before


def test_a_model_of_the_users_own_is_passed_over_with_safe_path(installed: Path, tmp_path: Path) -> None:
    """Check that -P removes the current folder from the search path, as docs/guide/install.md states."""
    (tmp_path / "eskin.py").write_text("print('mine')")
    assert run(installed, tmp_path, "-m", "eskin") == "mine\n"
    assert run(installed, tmp_path, "-P", "-m", "eskin").startswith("Usage: eskin ")
