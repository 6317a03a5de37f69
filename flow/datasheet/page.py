"""Write datasheets of all kinds of designs."""

import dataclasses
from pathlib import Path
from typing import Any

from eskin.base.errors import InputError
from eskin.base.files import read_json
from eskin.flow.datasheet import bus, classifier, frame_readout, readout, skin
from eskin.flow.datasheet.sheet import Sheet
from eskin.model.bus.config import BusConfig
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import FrameConfig
from eskin.model.tiles.config import MergeConfig, TilesConfig
from eskin.rtl.delivery import write
from eskin.rtl.verilog import Config

Described = ReadoutConfig | FrameConfig | ClassifierConfig | MergeConfig | BusConfig
"""Designs with a datasheet; a chip has the datasheets of its readout and classifier."""


def sheet_of(config: Described, report: dict[str, Any] | None = None) -> Sheet:
    """Return the datasheet of a design; ``report`` is ``report.json`` of the netlist of a readout."""
    if isinstance(config, FrameConfig):
        return frame_readout.sheet_of(config, report)
    if isinstance(config, BusConfig):
        return bus.sheet_of(config)
    if isinstance(config, ClassifierConfig):
        return classifier.sheet_of(config)
    if isinstance(config, MergeConfig | TilesConfig):
        return skin.sheet_of(config)
    return readout.sheet_of(config, report)


def load_report(path: Path, config: ReadoutConfig | FrameConfig) -> dict[str, Any]:
    """Return the netlist report that belongs to a configuration."""
    content: dict[str, Any] = read_json(path, "the report", dict)
    needed = ("configuration", "library", "area_um2_per_taxel", "fmax_hz", "flops", "gated_flops")
    if absent := [name for name in needed if name not in content]:
        raise InputError(f"{path} lacks {absent[0]} and is not a report of make asic; give report.json of make asic")
    stored, wanted = content["configuration"], config.to_dict()
    for name in dict.fromkeys([*wanted, *stored]):
        if stored.get(name) != wanted.get(name):
            raise InputError(
                f"the report {path} has {name} = {stored.get(name)}, not {wanted.get(name)}; give the report of "
                f"this configuration"
            )
    return content


def deliver(config: Config, folder: Path, report: Path | None = None, gated: bool = False) -> list[Path]:
    """Write Verilog, constraints, description and datasheet of a design into a folder; return their paths.

    A chip has no datasheet. ``report`` is ``report.json`` of the netlist of a readout; ``gated`` selects clock gates.
    """
    netlist = None
    readout = config.readout if isinstance(config, BusConfig) else config
    if report is not None and isinstance(readout, ReadoutConfig | FrameConfig):
        netlist = load_report(report, readout)
    paths = write(config, folder, gated)
    if isinstance(config, ChipConfig):
        return paths
    for design in (config.readout, config) if isinstance(config, BusConfig) else (config,):
        paths += dataclasses.replace(sheet_of(design, netlist), gated=gated).write(folder)
    return paths
