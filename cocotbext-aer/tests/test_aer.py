"""Run the testbenches on Icarus, or on the simulator in the variable SIM."""

import os
import re
from pathlib import Path

from cocotb_tools.check_results import get_results
from cocotb_tools.runner import get_runner

HERE = Path(__file__).parent


def test_benches(tmp_path: Path) -> None:
    runner = get_runner(os.environ.get("SIM", "icarus"))
    (bench,) = re.findall(r"```python\n(.*?)```", (HERE.parent / "README.md").read_text(), re.DOTALL)
    (tmp_path / "readme.py").write_text(bench)
    runner.build(sources=[HERE / "wires.v"], hdl_toplevel="wires", build_dir=tmp_path, timescale=("1ns", "1ps"))
    paths = [str(tmp_path), str(HERE), str(HERE.parent), os.environ.get("PYTHONPATH", "")]
    results = runner.test(
        test_module="benches,readme",
        hdl_toplevel="wires",
        build_dir=tmp_path,
        test_dir=tmp_path,
        extra_env={"PYTHONPATH": os.pathsep.join(paths)},
    )
    tests, failed = get_results(results)
    assert tests >= 23
    assert failed == 0
