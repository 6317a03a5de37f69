"""Fixture of the example library."""

import pytest

from eskin.flow.liberty.library import Library, read
from tests.flow import example_library


@pytest.fixture(scope="session")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    """Return the example library at its typical corner."""
    return read(example_library.written(tmp_path_factory.mktemp("library")))
