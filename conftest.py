"""Mark the tests of ``make check``, and start long tests first.

Hold-out configurations are drawn at random in every run: from ``ESKIN_HOLDOUT``, a whole number, or from a new one.
"""

import os
import secrets

import pytest

from tests.quick import chosen, long_first


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    for item in chosen(items):
        item.add_marker(pytest.mark.quick)
    if workers := getattr(config, "workerinput", {}).get("workercount"):
        items[:] = [items[place] for place in long_first([item.nodeid for item in items], workers)]


def pytest_configure() -> None:
    os.environ.setdefault("ESKIN_HOLDOUT", str(secrets.randbelow(10**6)))  # workers take that of who started them
    holdout_seed()


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    terminalreporter.write_line(f"hold-out seed: {holdout_seed()} (again: ESKIN_HOLDOUT={holdout_seed()})")


def holdout_seed() -> int:
    """Return the seed of this run."""
    text = os.environ["ESKIN_HOLDOUT"]
    if not text.isdecimal():
        raise pytest.UsageError(f"ESKIN_HOLDOUT must be a whole number, not {text!r}")
    return int(text)


@pytest.fixture(scope="session")
def holdout() -> int:
    """Return the seed of this run's hold-out configurations."""
    return holdout_seed()
