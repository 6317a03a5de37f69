"""``python -m flow``: proofs of the RTL, properties for others' tools, and what becomes of it in gates."""

from __future__ import annotations

from flow.commands.evidence import coverage, crosscheck, crossproof, faults, formal, properties
from flow.commands.mutants import model_mutants, mutants
from flow.commands.netlist import asic, asic_scale, gatesim, power
from flow.commands.places import fpga, layout
from model.cli.app import make_app, run

app = make_app("Design flow of the readout: proofs of its RTL, and its netlist.")

COMMANDS = (
    formal,
    faults,
    coverage,
    properties,
    mutants,
    model_mutants,
    crosscheck,
    crossproof,
    gatesim,
    asic,
    asic_scale,
    power,
    layout,
    fpga,
)
for command in COMMANDS:
    app.command()(command)


def main() -> None:
    """Run the command line of the design flow."""
    run(app, "python -m flow")


if __name__ == "__main__":
    main()
