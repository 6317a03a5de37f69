"""Write the properties as SystemVerilog assertions bound to the delivered Verilog."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jinja2

from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import FrameConfig
from eskin.rtl import yosys
from eskin.rtl.links import registry as links
from eskin.rtl.verilog import YOSYS_SCRIPT, header
from eskin.verify.proofs.bench import rtlil_of
from eskin.verify.proofs.blocks.arbiter import ArbiterChecker
from eskin.verify.proofs.blocks.frame import FrameChecker
from eskin.verify.proofs.blocks.link import LINKS
from eskin.verify.proofs.blocks.readout import ReadoutChecker
from eskin.verify.proofs.blocks.registers import HostChecker
from eskin.verify.proofs.blocks.taxel import TaxelChecker
from eskin.verify.proofs.blocks.window import WindowChecker
from eskin.verify.proofs.checker import Checker, inputs

ReadoutOrFrame = ReadoutConfig | FrameConfig

TEMPLATE = jinja2.Template(
    Path(__file__).with_name("assertions.sv").read_text(), trim_blocks=True, keep_trailing_newline=True
)


def checkers(config: ReadoutOrFrame) -> Iterator[tuple[Checker[Any], str, dict[str, str]]]:
    """Yield each checker of a readout, its module, and the signals connected to its inputs.

    Inputs that are not named have their own name in that module.
    """
    if isinstance(config, FrameConfig):
        yield FrameChecker(config), "eskin_frame_readout", {}
        return
    yield TaxelChecker(config), "eskin_taxel", {}
    if config.closes:
        yield WindowChecker(config), "eskin_window", {}
    if block := links.named(config.link).block:
        if block not in LINKS:
            raise InputError(f"the link {config.link} has no checker in verify/proofs/blocks/link.py")
        yield LINKS[block](config), block.module_name, {}
    if config.registers == "none":  # a host masks taxels too, and its test pattern sends events without a step
        whole = ReadoutChecker(config)
        yield whole, "eskin_readout", whole.places(config)
    else:
        yield HostChecker(config), "eskin_host", {}
    arbiter = ArbiterChecker(config)
    places = {name: f"arbiter.{name}" for name in arbiter.block(config).signature.members}
    taxels = [(row, column) for row in range(config.rows) for column in range(config.columns)]
    for name in ("request", "polarity"):
        places[name] = "{" + ", ".join(_line(config, name, *taxel) for taxel in reversed(taxels)) + "}"
    yield arbiter, "eskin_readout", places


def _line(config: ReadoutConfig, name: str, row: int, column: int) -> str:
    """Return the request or polarity of a taxel; a test pattern of the host replaces it."""
    own = f"row_{row}.taxel_{column}.{name}"
    if config.registers == "none":
        return own
    tested = "host.row_request" + (f"[{row}]" if config.rows > 1 else "")
    pattern = f"host.column_{name}" + (f"[{column}]" if config.columns > 1 else "")
    return f"({own} | ({tested} & {pattern}))" if name == "request" else f"({tested} ? {pattern} : {own})"


def properties(config: ReadoutOrFrame) -> str:
    """Return the SystemVerilog text with checkers, assertions and bindings."""
    parts = [
        header(config, "//"),
        "// Properties of the blocks, proved of the RTL (make formal); read it beside the Verilog.\n",
    ]
    for checker, module, places in checkers(config):
        text = yosys.run(YOSYS_SCRIPT.format(top=checker.module_name), rtlil_of(checker), "readout.v")
        parts += [yosys.tidy(text), _assertions(checker, module, places)]
    return "\n".join(parts)


def _assertions(checker: Checker[Any], module: str, places: dict[str, str]) -> str:
    """Return a checker's assertions, and the line that binds them to a module."""
    constants = checker.constants(checker.config)
    widths = {name: len(getattr(checker, name)) for name in inputs(checker)}
    ports = {"clk": 1, "rst": 1} | {name: width for name, width in widths.items() if name not in constants}
    outputs = [f"{kind}_{item}" for item in checker.proved for kind in ("ok", "seen")]
    outputs += [f"holds_{assumption}" for assumption in checker.assumptions]
    count = constants.get("watch", 1)  # an instance for each value
    wires = [f".{port}({port})" for port in (*ports, *outputs)]
    wires += [f".{name}({widths[name]}'((index + {offset}) % {count}))" for offset, name in enumerate(constants)]
    return TEMPLATE.render(
        name=checker.module_name.removesuffix("_properties"),
        checker=checker,
        ports=ports,
        outputs=outputs,
        count=count,
        wires=", ".join(wires),
        module=module,
        bound=", ".join(f".{port}({places.get(port, port)})" for port in ports),
    )
