"""Test that every part rejects a name that only the type hint allows."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from eskin.base.errors import InputError
from eskin.cocotb_tests.independent import link as independent
from eskin.cocotb_tests.independent.readout import Readout as IndependentReadout
from eskin.cocotb_tests.independent.settings import Settings
from eskin.cocotb_tests.independent.taxel import KINDS
from eskin.flow.datasheet.page import sheet_of
from eskin.flow.gate_count import count_gates
from eskin.model.config import ReadoutConfig
from eskin.model.encoders import registry
from eskin.model.links import registry as links
from eskin.model.readout import Stimulus, simulate
from eskin.model.taxel import decode, encode, error_bound
from eskin.rtl.encoders import registry as rtl
from eskin.rtl.links import registry as hardware
from eskin.rtl.verilog import verilog
from eskin.verify.proofs.bench import design
from eskin.verify.proofs.blocks import link as checkers
from eskin.verify.proofs.blocks.taxel import TaxelChecker

SAMPLES = np.array([[0, 0], [40, -40]])
STIMULUS = Stimulus.from_samples(ReadoutConfig(rows=1, columns=2), SAMPLES)
PARTS: dict[str, tuple[Callable[[ReadoutConfig], Any], set[str]]] = {
    "simulate": (lambda config: simulate(config, STIMULUS), {"encoding", "link", "frontend"}),
    "encode": (lambda config: encode(config, SAMPLES), {"encoding"}),
    "decode": (lambda config: decode(config, SAMPLES.astype(np.int16)), {"encoding"}),
    "bound": (error_bound, {"encoding"}),
    "Verilog": (verilog, {"encoding", "link", "frontend"}),
    "gates": (lambda config: count_gates(config, 2), {"encoding", "link", "frontend"}),
    "datasheet": (sheet_of, {"encoding", "link", "frontend"}),
    "proofs": (lambda config: design(TaxelChecker(config)), {"encoding", "frontend"}),
    "figures": (lambda config: registry.named(config.encoding).colour, {"encoding"}),
}


@pytest.mark.parametrize(
    ("part", "field"), [(part, field) for part, (_, knows) in PARTS.items() for field in sorted(knows)]
)
def test_an_unknown_name_is_refused(part: str, field: str) -> None:
    do, _ = PARTS[part]
    config = ReadoutConfig(rows=1, columns=2)
    object.__setattr__(config, field, "dpcm")  # as if it had been added to the type alone
    with pytest.raises(InputError, match="'dpcm'"):
        do(config)


@pytest.mark.parametrize("field", ["encoding", "link", "frontend"])
def test_the_independent_model_knows_no_other_name(field: str) -> None:
    with pytest.raises(KeyError, match="dpcm"):
        IndependentReadout(Settings(**{field: "dpcm"})).clock()


def test_every_link_has_hardware_a_second_reading_and_a_checker() -> None:
    assert [*hardware.LINKS] == [*independent.LINKS] == list(links.NAMES)
    assert {one.block for one in hardware.LINKS.values()} - {None} == set(checkers.LINKS)
    for link in links.LINKS:
        config = ReadoutConfig.from_dict({"link": link.name})
        own = hardware.named(link.name)
        ports = own.ports(config)
        assert set(ports) <= set(own.meanings)
        assert {*link.requests, *link.address, *own.asynchronous} <= set(ports)


def test_every_encoder_has_hardware_and_a_second_reading() -> None:
    assert set(registry.NAMES) == set(KINDS)
    assert [*rtl.ENCODERS] == list(registry.NAMES)
