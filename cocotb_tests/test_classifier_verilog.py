"""Test the Verilog of the classifier: lint, resets, memories, and the files beside it."""

import json
import random
import re
from pathlib import Path

import pytest

from eskin.cocotb_tests.blocks.classifier import random_network
from eskin.cocotb_tests.test_classifier import CONFIGS, OWN, STACKS, SYNAPTIC, name
from eskin.cocotb_tests.test_verilog import delivered
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.classifier.file import IntegerWeights
from eskin.rtl.delivery import ports
from tests.conftest import run_eskin as call

TOP = "eskin_classifier"
PAPERS = ClassifierConfig(floor=-256, out_floor=-256)


@pytest.mark.parametrize(
    "config", [CONFIGS[1], CONFIGS[5], CONFIGS[7], SYNAPTIC[0], OWN[1], STACKS[0], PAPERS], ids=name
)
def test_files_are_clean_complete_and_agree(config: ClassifierConfig, tmp_path: Path) -> None:
    text, _, described = delivered(config, tmp_path)
    bits = {}
    for module in re.findall(r"^module .*?^endmodule", text, re.MULTILINE | re.DOTALL):
        parts = re.findall(r"^  reg (?:\[(\d+):0\] )?memory\w* \[(\d+):0\];", module, re.MULTILINE)
        bits[re.split(r"\W", module)[1]] = sum((int(high or 0) + 1) * (int(last) + 1) for high, last in parts)
    assert (
        sum(count for name, count in bits.items() if name.endswith(("_weights", "_parameters"))) == config.memory_bits
    )
    assert bits.get("eskin_potentials", 0) == (config.hidden * config.membrane_bits if config.synapse_shift else 0)
    assert ClassifierConfig.from_dict(described["configuration"]) == config
    assert described["clock_hz"] == config.clock_hz


def test_ports_are_those_of_the_contract() -> None:
    widths = {port["name"]: port["width"] for port in ports(PAPERS)}
    loading = {"load_valid": 1, "load_neurons": 1, "load_address": 13, "load_data": 128}
    events = {"event_valid": 1, "event_ready": 1, "event_channel": 7, "bin_end": 1, "scan_start": 1}
    classes = {"class_valid": 1, "class_index": 3, "evidence": 6 * 24, "overrun": 1, "stall_count": 24}
    hidden = {"hidden_valid": 1, "hidden_index": 8, "hidden_potential": 24, "hidden_spike": 1}
    outputs = {"output_valid": 1, "output_index": 3, "output_potential": 20, "output_spike": 1}
    assert widths == {"clk": 1, "rst": 1} | loading | events | classes | hidden | outputs


def test_command_writes_the_classifier_of_a_file(tmp_path: Path) -> None:
    config = CONFIGS[0]
    weights = IntegerWeights(random_network(config, random.Random(1)), ("a", "b", "c"))
    weights.save(tmp_path / "integer.npz")
    command = ["verilog", "--classifier", tmp_path / "integer.npz", "-o"]
    assert call(*command, tmp_path / "out", "--reset", "async").returncode == 0
    described = json.loads((tmp_path / "out" / f"{TOP}.json").read_text())
    assert ClassifierConfig.from_dict(described["configuration"]) == config.replace(reset="async")
    assert "| `reset` | async |" in (tmp_path / "out" / f"{TOP}_datasheet.md").read_text()
    array = ["--chip", "--rows", 1, "--columns", config.inputs]
    assert call(*command, tmp_path / "chip", *array).returncode == 0
    described = json.loads((tmp_path / "chip" / "eskin_chip.json").read_text())["configuration"]
    assert (described["rows"], described["columns"]) == (1, config.inputs)
    done = call(*command, tmp_path / "no", "--rows", 3)
    assert done.returncode == 2
    assert "--rows has no effect with --classifier alone: add --chip, or leave one of the two out" in done.stderr
    assert not (tmp_path / "no").exists()
