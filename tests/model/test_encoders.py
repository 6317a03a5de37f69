"""Test the registry of encoders."""

import inspect
from collections import namedtuple
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple, get_args

import pytest

from eskin.model import readout, window
from eskin.model.config import Encoding, ReadoutConfig
from eskin.model.encoders import compiled, registry
from eskin.model.encoders.encoder import Constants
from eskin.model.encoders.lcs import Lcs


def test_every_encoder_is_found_by_its_name() -> None:
    assert [registry.named(name) for name in get_args(Encoding)] == list(registry.ENCODERS)


class Twin(Lcs):
    name, title, colour, marker = "twin", "Twin", "#000000", "x"


class LcsRule(NamedTuple):
    step: int


class Other(Twin):
    code = 3
    Rule = LcsRule


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


ExtraRule = namedtuple("ExtraRule", (*Constants._fields, "pause"))  # type: ignore[misc]


class Extra(Lcs):
    Rule = ExtraRule

    def extra_constants(self, config: ReadoutConfig) -> tuple[int, ...]:
        return (config.window_period,)


def test_settings_of_a_host_keep_a_constant_of_the_encoder_itself() -> None:
    rule = Extra().rule(ReadoutConfig(resolution=6, window_period=7))
    now = SimpleNamespace(coarser=2, window_period=3, leak_shift=4, leak_period=5)
    found = compiled.with_settings(rule, now)
    assert (type(found), found.step, found.window_period, found.pause) == (ExtraRule, 64, 3, 7)
    assert found._replace(step=16, closing_step=4, window_period=7, leak_shift=6, leak_period=63) == rule


def test_an_encoder_reads_fields_of_the_configuration() -> None:
    fields = ReadoutConfig().to_dict()
    assert all(set(encoder.parameters) <= set(fields) for encoder in registry.ENCODERS)
    assert all(0 <= encoder.code < 8 for encoder in registry.ENCODERS)  # three bits of the register ``shape``
