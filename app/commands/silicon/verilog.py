"""The commands verilog and gates."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eskin.app.commands import common
from eskin.app.options import LOGIC, check_frame, command, opt, option_name, out_folder, with_config, with_fields
from eskin.app.tables import print_table
from eskin.base.errors import InputError
from eskin.base.units import counted
from eskin.model.bus.config import BUSES, BusConfig
from eskin.model.cases import axes, cases
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import OWN_FIELDS, FrameConfig
from eskin.model.tiles.config import MergeConfig, skin_of

if TYPE_CHECKING:
    from eskin.rtl.verilog import Config

READOUTS = ("spiking", "frame")


@command(
    "Hardware",
    variables="OUT=out/verilog",
    fuzz="-o good/config.json/new",
    idle={
        "--merge": "--relays",
        "no --tiles": "--merge --relays",
        "--tiles": "--classifier --chip --readout --report "
        "--clock-gates --word-bits --settle-clocks --conversion-clocks",
        "no --classifier": "--chip",
        "--classifier": "--readout --report",
        "--readout=frame": "SPIKING --tau",
    },
)
@with_config
@with_fields(FrameConfig, OWN_FIELDS, "own")
def verilog(
    config: ReadoutConfig,
    given: frozenset[str],
    own: dict[str, Any],
    stored: dict[str, Any],
    out: Path = out_folder(..., "output folder, created if missing"),
    readout: str = opt("spiking", "|".join(READOUTS), "which readout"),
    classifier: Path | None = opt(None, "INTEGER.npz", "write the classifier of this file, eskin_classifier"),
    chip: bool = opt(False, "--chip", "write the readout with this classifier, eskin_chip"),
    tiles: str | None = opt(None, "RxC", "write a skin of RxC tiles and their merge, eskin_tiles"),
    merge: bool = opt(False, "--merge", "write only the merge, eskin_merge, for tiles that are separate chips"),
    relays: int = opt(0, "N", "relay stations on the line from each tile to the merge, for a large skin"),
    bus: str | None = opt(None, "|".join(BUSES), "put the readout behind AXI4-Stream, its registers behind AXI4-Lite"),
    time_bits: int | None = opt(None, "N", "bits of a time stamp in clocks in every event behind the bus"),
    report: Path | None = opt(None, "report.json", "report of make asic, for the datasheet"),
    prove: bool = opt(False, "--prove", "before writing, prove the Verilog equal to the RTLIL of make formal"),
    clock_gates: bool = opt(
        False, "--clock-gates", "put instances of eskin_clock_gate into the Verilog of a readout, a classifier or both"
    ),
) -> None:
    """Write the Verilog of a readout with timing constraints, port list (JSON) and FuseSoC core file.

    The files are eskin_readout.v or eskin_frame_readout.v, .sdc, .json, .core and the testbench _tb.sv. --registers spi
    adds eskin_registers.h, .rdl (SystemRDL), .xml (IP-XACT) and .md. All designs except --chip also get a datasheet.
    """
    if bus is not None or time_bits is not None:
        spiking = spiking_or_frame(readout, config, given, stored | own)
        others = {"--tiles": tiles, "--classifier": classifier, "--readout frame": isinstance(spiking, FrameConfig)}
        design = _behind(bus, time_bits, config, [name for name, is_given in others.items() if is_given])
        _deliver(design, out, prove, report, clock_gates)
        return
    if tiles is not None:
        if stored:
            raise InputError(f"{next(iter(stored))} of the configuration has no effect with --tiles; leave it out")
        skin = skin_of(config, tiles, relays)
        _deliver(MergeConfig(skin) if merge else skin, out, prove)
        return
    if classifier is not None:
        from eskin.model.classifier.chip_config import ChipConfig
        from eskin.model.classifier.file import IntegerWeights

        if idle := sorted({*own, *stored} if chip else {*given, *own, *stored} - {"reset"}):
            hint = "" if chip else " alone: add --chip, or"
            raise InputError(
                f"--{idle[0].replace('_', '-')} has no effect with --classifier{hint or ':'} leave one of the two out"
            )
        found = IntegerWeights.load(classifier).network.config.replace(reset=config.reset)
        _deliver(ChipConfig(readout=config, classifier=found) if chip else found, out, prove, gated=clock_gates)
        return
    _deliver(spiking_or_frame(readout, config, given, stored | own), out, prove, report, clock_gates)


def _behind(bus: str | None, time_bits: int | None, readout: ReadoutConfig, idle: list[str]) -> BusConfig:
    """Return the configuration of a readout behind a bus."""
    if bus is None:
        raise InputError("--time-bits has no effect without --bus; add --bus axi")
    if bus not in BUSES:
        raise InputError(f"--bus must be one of {', '.join(BUSES)}, not {bus!r}")
    if idle:
        raise InputError(f"--bus has no effect with {idle[0]}: leave one of the two out")
    return BusConfig(readout=readout, time_bits=time_bits or 0)


def spiking_or_frame(
    readout: str, config: ReadoutConfig, given: frozenset[str], own: dict[str, Any]
) -> ReadoutConfig | FrameConfig:
    """Return the configuration of the readout that ``--readout`` names; ``own`` are the fields of a frame readout."""
    if readout not in READOUTS:
        raise InputError(f"--readout must be one of {', '.join(READOUTS)}, not {readout!r}")
    if readout == "frame":
        check_frame(config, given)
        return FrameConfig(readout=config, **own)
    if own:
        raise InputError(f"--{next(iter(own)).replace('_', '-')} is for the frame readout; add --readout frame")
    return config


def _deliver(config: Config, out: Path, prove: bool, report: Path | None = None, gated: bool = False) -> None:
    """Write a design and its datasheet into a folder, optionally after proving the Verilog."""
    from eskin.flow.datasheet.page import deliver

    if prove and gated:
        from eskin.verify.proofs.gated import prove_gated

        print(f"proved equal to the RTLIL: {prove_gated(config)} points")
    elif prove:
        from eskin.verify.proofs.delivered import prove_config

        points = prove_config(config)
        print(f"proved equal to the RTLIL: {sum(points.values())} points of {len(points)} modules")
    for path in deliver(config, out, report, gated):
        print(path)
    config = config.readout if isinstance(config, BusConfig) else config
    if isinstance(config, ReadoutConfig):
        clocks = config.protocol.clocks_per_event
        print(
            f"the link {config.link} sends at most {config.clock_hz / clocks:,.0f} events/s "
            f"({counted(clocks, 'clock')} per event, clock {config.clock_hz:g} Hz)"
        )


@command("Hardware", fuzz="--liberty good/nothing.lib")
@with_config(fields=[name for name in LOGIC if name != "encoding"], every=True)
def gates(
    config: ReadoutConfig,
    given: frozenset[str],
    stored: dict[str, Any],
    liberty: Path | None = opt(None, "cell library (.lib) for mapping and area"),
    classifier: Path | None = opt(None, "INTEGER.npz", "count the classifier of this file, without memories"),
    as_json: common.Json = False,
) -> None:
    """Count the gates and flops of both readouts for the same array, or of a classifier."""
    from eskin.flow.gate_count import count_gates

    if classifier is not None:
        if given:
            raise InputError(f"{option_name(min(given))} has no effect with --classifier: leave one of the two out")
        _count_classifier(classifier, liberty, as_json)
        return
    designs: dict[str, ReadoutConfig | FrameConfig] = {one.encoding: one for one in cases(config, **axes("encoding"))}
    designs["frame"] = FrameConfig(readout=config.replace(registers="none", receptive_fields="own"), **stored)
    counted = {name: count_gates(design, config.taxels, liberty).to_dict() for name, design in designs.items()}
    if as_json:
        print(json.dumps({"liberty": liberty.name if liberty else None, "readouts": counted}, indent=2))
        return
    unit = f"cells of {liberty.name}" if liberty else "two-input gates"
    title = f"{config.rows} x {config.columns} taxels, {config.resolution} b, {config.frontend}: {unit}"
    print_table(
        "readout | flops | gates | per taxel | um2 per taxel",
        [numbers | {"name": name} for name, numbers in counted.items()],
        "{name} | {flops:.0f} | {gates:.0f} | {flops_per_taxel:.1f} + {gates_per_taxel:.1f} | {area_um2_per_taxel:.0f}",
        title,
    )


def _count_classifier(path: Path, liberty: Path | None, as_json: bool) -> None:
    """Print the gates and flops of a classifier."""
    from eskin.flow.gate_count import count_gates
    from eskin.model.classifier.file import IntegerWeights

    config = IntegerWeights.load(path).network.config
    found = count_gates(config, 1, liberty)
    if as_json:
        numbers = {"flops": found.flops, "gates": found.gates, "area_um2": found.area_um2}
        numbers["memory_bits"] = config.memory_bits
        said = {"liberty": liberty.name if liberty else None, "configuration": config.to_dict(), "classifier": numbers}
        print(json.dumps(said, indent=2))
        return
    area = "" if found.area_um2 is None else f", {found.area_um2 / 1e6:.3f} mm2 of cells of {liberty and liberty.name}"
    size = f"{config.inputs}-{config.hidden}-{config.classes}, {config.lanes} lanes"
    print(f"{size}: {found.flops} flops, {found.gates} gates{area}, beside {config.memory_bits} bits of memory")
