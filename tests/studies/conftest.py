"""Fixtures of the tests of the studies."""

from tests.snn.conftest import eskin

__all__ = ["eskin"]
