"""Skip tests that need Icarus if it is not installed, except in CI."""

import os
from collections.abc import Generator

import pytest

from eskin.cocotb_tests.runner.simulator import MissingProgram


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call() -> Generator[None, None, None]:
    try:
        return (yield)
    except MissingProgram as missing:
        if os.environ.get("CI"):
            raise
        pytest.skip(str(missing))
