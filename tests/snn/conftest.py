"""Fixtures of the tests of the classifier."""

from collections.abc import Callable

import pytest

from tests.conftest import Call


@pytest.fixture
def eskin(call: Call) -> Callable[..., tuple[str, str]]:
    """Return a function that runs ``eskin``, checks its exit code, and returns standard output and standard error."""

    def eskin(*words: object, code: int = 0) -> tuple[str, str]:
        found, out, error = call(*words)
        assert found == code, out + error
        return out, error

    return eskin
