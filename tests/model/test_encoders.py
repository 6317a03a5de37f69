"""Test the registry of encoders."""

import inspect
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple, get_args

import pytest

from eskin.model import readout, window
from eskin.model.config import Encoding, ReadoutConfig
from eskin.model.encoders import compiled, registry
from eskin.model.encoders.lcs import Lcs


def test_every_encoder_is_found_by_its_name() -> None:
    assert [registry.named(name) for name in get_args(Encoding)] == list(registry.ENCODERS)


class Twin(Lcs):
    name, title, colour, marker = "twin", "Twin", "#000000", "x"


class LcsRule(NamedTuple):
    step: int


class Other(Twin):
    code = 3
    Rule = LcsRule  # type: ignore[assignment]


@pytest.mark.parametrize(("other", "said"), [(Twin(), "code 0; use different ones"), (Other(), "Rule 'LcsRule'")])
def test_no_two_encoders_share_a_code_or_compiled_loops(other: Lcs, said: str) -> None:
    with pytest.raises(ValueError, match=f"two encoders have the {said}"):
        registry.check((Lcs(), other))


def test_an_edit_of_any_file_of_an_encoder_makes_compiled_loops_stale() -> None:
    sources = set(compiled.sources())
    folder = Path(compiled.__file__).parent
    of_encoders = {Path(str(inspect.getfile(type(encoder)))) for encoder in registry.ENCODERS}
    assert {folder, folder / "encoder.py", folder / "compiled.py", Path(window.__file__), *of_encoders} <= sources
    assert sources <= set(readout.SOURCES)


def test_every_compiled_function_calls_that_of_the_encoder() -> None:
    for encoder in registry.ENCODERS:
        config = ReadoutConfig.from_dict({"encoding": encoder.name})
        rule = encoder.rule(config)
        taxel = SimpleNamespace(x=3 * config.step, u=0, **dict.fromkeys(encoder.state, 0))
        assert compiled.compare(rule, taxel) == (True, False)
        reach = compiled.reach(rule, taxel)
        compiled.move(rule, taxel, True, False, True, False)
        assert taxel.u == reach == config.step << encoder.fraction_bits(config)


def test_an_encoder_reads_fields_of_the_configuration() -> None:
    fields = ReadoutConfig().to_dict()
    assert all(set(encoder.fields) <= set(fields) for encoder in registry.ENCODERS)
    assert all(0 <= encoder.code < 8 for encoder in registry.ENCODERS)  # three bits of the register ``shape``
