"""Run the examples in docstrings."""

import doctest
from importlib import import_module

import pytest

EXAMPLES = {
    "eskin.app.make": "typed_variables",
    "eskin.base.shapes": "misfit",
    "eskin.model.config": "ReadoutConfig",
    "eskin.model.taxel": "encode",
    "eskin.model.readout": "simulate",
    "eskin.model.events.recording": "Recording",
    "eskin.flow.asic.synthesis": "single_bits",
    "eskin.flow.liberty.boolean": "possible",
    "eskin.snn.kernels.layer": "layer",
    "eskin.snn.exchange.transforms": "LevelCrossing",
}


@pytest.mark.parametrize(("name", "of"), EXAMPLES.items())
def test_the_examples_of(name: str, of: str) -> None:
    module = import_module(name)
    found = {test.name: test for test in doctest.DocTestFinder().find(module)}
    assert found[f"{name}.{of}"].examples
    assert doctest.testmod(module).failed == 0
