"""Run the example unchanged, and with each planted bug that the checker must find."""

import os
import re
from contextlib import suppress
from pathlib import Path

import pytest
from cocotb_tools.check_results import get_results
from cocotb_tools.runner import get_runner

HERE = Path(__file__).parent


@pytest.mark.parametrize(
    ("bug", "rule"), [(None, None), ("BUG_ADDRESS", "ADDRESS_HELD"), ("BUG_REQUEST", "REQUEST_HELD")]
)
def test_encoder(bug: str | None, rule: str | None, tmp_path: Path) -> None:
    runner = get_runner(os.environ.get("SIM", "icarus"))
    runner.build(
        sources=[HERE / "encoder.v"],
        hdl_toplevel="encoder",
        build_dir=tmp_path,
        defines={bug: 1} if bug else {},
        timescale=("1ns", "1ps"),
    )
    paths = [str(HERE), str(HERE.parents[1]), os.environ.get("PYTHONPATH", "")]
    log = tmp_path / "log"
    with suppress(SystemExit):  # how the runner ends where a test fails
        runner.test(
            test_module="bench",
            hdl_toplevel="encoder",
            build_dir=tmp_path,
            test_dir=tmp_path,
            log_file=log,
            results_xml=str(tmp_path / "results.xml"),
            extra_env={"PYTHONPATH": os.pathsep.join(paths)},
        )
    tests, failed = get_results(tmp_path / "results.xml")
    assert tests == 1
    assert failed == (bug is not None)
    found = re.search(r"AerProtocolError: (\w+) at \d+ ps", log.read_text())
    assert (found and found[1]) == rule
