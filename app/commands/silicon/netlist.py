"""The commands gatesim, asic and gatepower (docs/guide/verilog.md, docs/guide/power.md)."""

from pathlib import Path
from typing import Any

from eskin.app.commands import common
from eskin.app.commands.silicon.verilog import READOUTS, spiking_or_frame
from eskin.app.options import command, opt, out_folder, with_config, with_fields
from eskin.app.tables import print_table
from eskin.base.errors import InputError
from eskin.base.files import origin
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import OWN_FIELDS, FrameConfig


@command("Hardware", needs="sim asic", switch="sim GATES", idle={"--only": "--seed --textures"})
@with_config
def gatesim(
    config: ReadoutConfig,
    lib: Path = opt(..., "cell library (.lib) of the netlist"),
    simulator: str = opt("icarus", "--sim", "icarus or verilator"),
    waves: bool = opt(False, "write a waveform"),
    seed: int = opt(0, "seed of the scenarios"),
    textures: int = opt(1, "scans, from alternating classes"),
    only: str | None = opt(None, "one texture, by name, without scenarios"),
    ticks: int | None = opt(None, "largest number of sample ticks per scan [all]"),
    dataset: str | None = opt(None, "texture folder, or 'embedded'"),
    out: Path = out_folder(Path("out/gates"), "folder for netlist, pictures, events"),
) -> None:
    """Compare a clock-gated netlist with the model; exit code 1 on a difference or an X after reset."""
    from eskin.cocotb_tests.runner import sim as session
    from eskin.cocotb_tests.runner.process import MismatchFound
    from eskin.flow.gatesim.sim import play, prepare

    plan = session.plan(simulator, waves, seed, textures, only, ticks, dataset, out)
    gates = prepare(config, lib, out)
    print(gates.netlist, gates.cells, sep="\n")
    unknown = gates.unknown
    if not unknown.clean:
        left = [*unknown.in_reset, *unknown.after, *unknown.outputs]
        common.fail(f"UNKNOWN after a reset with unknown inputs: {len(left)} of {unknown.flops} flops, {left[:3]}")
    print(f"known after a reset with unknown inputs: all {unknown.flops} flops")
    with common.failing_on(MismatchFound, line=f"MISMATCH; log: {plan.running(config)}"):
        tally = play(plan, gates, config, f"--lib {lib}", lambda stage: print(f"{config.encoding}: {stage}"))
    print(common.bit_exact(tally))


@command("Hardware", needs="sim asic", idle={"--readout=frame": "SPIKING --tau"})
@with_config
@with_fields(FrameConfig, OWN_FIELDS, "own")
def asic(
    config: ReadoutConfig,
    given: frozenset[str],
    own: dict[str, Any],
    stored: dict[str, Any],
    lib: Path = opt(..., "cell library (.lib) at the typical corner"),
    slow: Path | None = opt(None, "the same cells at the slow corner"),
    fast: Path | None = opt(None, "the same cells at the fast corner"),
    readout: str = opt("spiking", "|".join(READOUTS), "which readout"),
    name: str = opt("", "name of the run and its folder [from the configuration]"),
    power: bool = opt(True, "also measure idle power and energies, by simulation"),
    from_verilog: bool = opt(False, "--from-verilog", "map the Verilog of verilog --clock-gates instead of the RTL"),
    out: Path = out_folder(Path("out/asic"), "parent folder of the run"),
) -> None:
    """Synthesise a clock-gated netlist, verify it, and measure area, timing and power; exit code 1 if a check fails.

    OUT/NAME gets the netlist, its constraints (.sdc) and report.json.
    """
    from eskin.flow import report
    from eskin.flow.power.measure import APART

    chosen = spiking_or_frame(readout, config, given, stored | own)
    if from_verilog and readout == "frame":
        raise InputError("--from-verilog is for the spiking readout: frames have no clock gates in their Verilog")
    common.check_name(name)
    corners = {"typical": lib} | {corner: at for corner, at in (("slow", slow), ("fast", fast)) if at}
    found = report.run(chosen, corners, name, lambda stage: print(stage, flush=True), power, from_verilog)
    print(found.write(out, report.command_of(chosen, corners, power, from_verilog)))
    proof = found.equivalence
    print(f"equivalent to the RTL: {proof.proved} of {proof.of} points proved")
    if found.structure.warning:
        print(f"note: {found.structure.warning}")
    if apart := found.more.get("with_wires", {}).get(APART):
        print(f"power with wires was not measured: {apart}")
    common.conclude(found.problems, found.closing_line())


@command("Hardware", needs="sim asic", idle={"--three": "--encoding --frontend"})
@with_config
def gatepower(
    config: ReadoutConfig,
    lib: list[Path] = opt(..., "cell library (.lib), repeatable"),
    three: bool = opt(False, "--three", "measure analog LCS, analog N-LCS and frames of this array"),
    glitching: bool = opt(False, "--glitches", "measure the energy of an event with and without cell delays"),
    weights: Path | None = opt(None, "measure the classifier of this network behind the readout, without wires"),
    out: Path = out_folder(Path("out/gatepower"), "folder for the results, JSON"),
) -> None:
    """Measure the power of clock-gated netlists by simulation, with and without wires."""
    from eskin.cocotb_tests.runner.reproduce import variables
    from eskin.flow.power.event_bench import Mismatch
    from eskin.flow.power.measure import Disagreement
    from eskin.flow.power.results import designs, write, write_classifier, write_glitches

    if three + glitching + (weights is not None) > 1:
        raise InputError(
            "--glitches measures one readout, --three measures three readouts, --weights measures a classifier; "
            "give only one of these options"
        )
    chosen: dict[str, ReadoutConfig | FrameConfig] = {str(config.encoding): config}
    chosen = designs(config) if three else chosen
    words = ["gatepower", *(f"LIB={path.name}" for path in lib), *variables(config)]
    said = origin(common.make_line(" ".join(words), THREE=three, GLITCHES=glitching, WEIGHTS=weights))
    with common.failing_on(Disagreement, Mismatch):
        if weights is not None:
            for path in lib:
                result = write_classifier(config, weights, path, out, said)
                event, idle = 1e12 * result["energy_per_event_j"], 1e6 * result["idle_w"]
                print(f"{path.name}: {event:.0f} pJ an event, {idle:.2f} uW idle, without wires and memories")
            return
        for path in lib if glitching else ():
            for name, share in write_glitches(config, path, out, said).items():
                print(f"{path.name}: glitches add {100 * share:.1f} % to an event ({name})")
        if glitching:
            return
        found = [_with_names(result) for path in lib for result in write(chosen, path, out, said)]
    print_table(
        "readout | library | wires | idle nW | leakage nW | pJ an event | lone | texture | OpenSTA/tables",
        found,
        "{name} | {process} | {wires} | {idle_w_per_taxel:1e9*.1f} | {leakage_w_per_taxel:1e9*.1f}"
        " | {?energy_per_event_j:1e12*.2f} | {?energy_per_lone_event_j:1e12*.2f}"
        " | {?energy_per_texture_event_j:1e12*.2f} | {ratios}",
        "Power of the logic: per taxel, and per event beside that",
    )


def _with_names(result: dict[str, Any]) -> dict[str, Any]:
    """Return a power measurement with names for its table row."""
    ratios = [stretch["agreement"] for stretch in result["scenarios"].values()]
    return result | {
        "name": f"{result['readout']} {result['frontend']}".strip(),
        "wires": "estimated" if result["pitch_um"] else "none",
        "ratios": f"{min(ratios):.3f} to {max(ratios):.3f}",
    }
