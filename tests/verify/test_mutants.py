"""Test the operators for Amaranth code, and a session of Cosmic Ray on the RTL."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from cosmic_ray.modules import filter_paths, find_modules
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import operator_names

from eskin.verify.mutants.hardware import Hardware

ROOT = Path(__file__).parents[2]
CONFIGS = sorted((ROOT / "verify" / "mutants").glob("*.toml"))


@pytest.mark.quick
@pytest.mark.parametrize("name", Hardware())
def test_every_operator_makes_its_examples(name: str) -> None:
    operator = Hardware()[name]
    assert f"hardware/{name}" in operator_names()  # the entry point in pyproject.toml
    examples = operator.examples()
    assert examples
    for example in examples:
        assert mutate_code(example.pre_mutation_code, operator(), example.occurrence) == example.post_mutation_code
    assert mutate_code(examples[-1].pre_mutation_code, operator(), len(examples)) is None
    assert mutate_code("n.d.comb += a.eq(b.all_of(Muxer(c, d)))\nn.If(a)", operator(), 0) is None


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_configurations_name_what_exists(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    config = tomllib.loads(path.read_text())["cosmic-ray"]
    assert config["module-path"] == [path.stem]
    every = list(find_modules([Path(path.stem)]))
    for excluded in config["excluded-modules"]:
        assert len(filter_paths(every, [excluded])) < len(every), excluded
    assert len(filter_paths(every, config["excluded-modules"])) > 5
    tests = [word for word in config["test-command"].split() if "tests/" in word]
    assert tests
    assert all((ROOT / test).exists() for test in tests)


def test_a_session_kills_mutants_and_lists_survivors(tmp_path: Path) -> None:
    for name in ("base", "cocotb_tests", "eskin", "model", "rtl", "tests"):
        shutil.copytree(ROOT / name, tmp_path / name, symlinks=True)
    for name in ("conftest.py", "pyproject.toml"):
        shutil.copy(ROOT / name, tmp_path)
    text = (ROOT / "verify" / "mutants" / "rtl.toml").read_text()
    tests = tomllib.loads(text)["cosmic-ray"]["test-command"].partition(" -m quick ")[2]
    for old, new in (
        ('module-path = ["rtl"]', 'module-path = ["rtl/window.py", "rtl/decay.py"]'),
        (f"-m quick {tests}", "-k analog-m1-5 cocotb_tests/test_window.py"),
        ("exclude-operators = [", 'exclude-operators = ["core/", "hardware/(Drop|Stick)",'),
    ):
        assert text.count(old) == 1
        text = text.replace(old, new)
    (tmp_path / "few.toml").write_text(text)

    def run(program: str, *words: str) -> str:
        bin = Path(sys.executable).parent
        own = {"PYTHONPATH": str(tmp_path), "PATH": f"{bin}{os.pathsep}{os.environ['PATH']}"}
        command = [str(bin / program), *words]
        return subprocess.run(command, cwd=tmp_path, env=os.environ | own, check=True, stdout=-1, text=True).stdout

    run("cosmic-ray", "init", "few.toml", "few.sqlite")
    run("cr-filter-operators", "few.sqlite", "few.toml")
    run("cosmic-ray", "exec", "few.toml", "few.sqlite")
    survivors = run("cr-report", "--surviving-only", "--show-diff", "few.sqlite")
    assert "surviving mutants: 1 " in survivors  # the tests of the window do not test the leak
    assert "+            m.d.sync += count.eq(Mux(count == self.config.leak_period - 1, (count + 1)" in survivors
    killed = re.findall(r"(rtl/\S+ hardware/\S+ \d)\n.*TestOutcome.KILLED", run("cr-report", "few.sqlite"))
    assert sorted(killed) == [f"rtl/window.py hardware/SwapChoice {number}" for number in range(2)]
