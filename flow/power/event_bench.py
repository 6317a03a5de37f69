"""Simulate scenarios on a netlist, record the activity of its nets, and compare its events with the model."""

from pathlib import Path
from typing import Any

from eskin.cocotb_tests.bench.analog import Comparators
from eskin.cocotb_tests.bench.readout import read_events, write_stimulus
from eskin.cocotb_tests.runner.simulator import HARNESS, shape
from eskin.flow import programs
from eskin.flow.gatesim.flat_netlist import FlatNetlist
from eskin.flow.power.activity import DUMP, HALF_NS, Activity, read_dump
from eskin.flow.power.scenarios import Scenario
from eskin.model.config import ReadoutConfig
from eskin.model.events.compare import first_difference


class Mismatch(Exception):  # the expected outcome for a faulty netlist, not a defect of this program
    """Raised if a netlist differs from the model; has the numbers of events of both."""

    def __init__(self, text: str, netlist: int = 0, model: int = 0) -> None:
        super().__init__(text)
        self.events = {"netlist": netlist, "rtl": model}


def play(
    scenario: Scenario, config: ReadoutConfig, netlist: FlatNetlist, cells: str, folder: Path, parts: int = 1
) -> tuple[Activity, int]:
    """Simulate a scenario; return net activity and number of events in its window; ``parts`` as in ``read_dump``."""
    # Clock 0 ends at the edge 8 ns after `running` rises; the dump begins with the falling edge before its window.
    first_edge = 2 * HALF_NS * (scenario.start + 1)
    macros, parameters = shape(config)
    player = programs.filled(
        "player.v",
        parameters=", ".join(f".{name}({value})" for name, value in parameters.items()),
        before=first_edge - HALF_NS - 1,
        inside=2 * HALF_NS * scenario.clocks + 6,
        file=DUMP,
    )
    write_stimulus(config, folder, scenario.stimulus, Comparators(holds=True))
    if any(port.name == "test_enable" for port in netlist.ports):  # the extra port of netlists
        macros = macros | {"TEST_ENABLE": "1"}
    defined = "".join(f"`define {name} {value}\n" for name, value in macros.items())
    texts = [defined + HARNESS.read_text(), netlist.verilog(gather=True), cells, player]
    errors = int(programs.icarus(texts, "play", folder).split()[-1])
    events = read_events(folder)
    _hold_to_model(scenario, events, errors)
    return read_dump(folder / DUMP, HALF_NS + 1, scenario.clocks, netlist.nets, parts), scenario.inside(events)


def _hold_to_model(scenario: Scenario, events: Any, errors: int) -> None:
    """Raise Mismatch if the events of a run differ from those of the model, or its link broke the protocol."""
    if difference := first_difference(scenario.events, events):
        raise Mismatch(
            f"{scenario.name}: the netlist does not do what the model does: "
            f"{difference.describe(('model', 'netlist'))}; its power would mean nothing",
            len(events),
            len(scenario.events),
        )
    if errors:
        said = f"{scenario.name}: the netlist breaks the protocol of its link {errors} times"
        raise Mismatch(said, len(events), len(scenario.events))
