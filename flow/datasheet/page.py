"""Write datasheets of all kinds of designs."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from eskin.flow.datasheet import classifier, frame_readout, readout, skin
from eskin.flow.datasheet.asic_results import load_report
from eskin.flow.datasheet.sheet import Sheet
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import FrameConfig
from eskin.model.tiles.config import MergeConfig, TilesConfig
from eskin.rtl.delivery import write
from eskin.rtl.verilog import Config

Described = ReadoutConfig | FrameConfig | ClassifierConfig | MergeConfig
"""Designs with a datasheet; a chip has the datasheets of its readout and classifier."""


def sheet_of(config: Described, report: dict[str, Any] | None = None) -> Sheet:
    """Return the datasheet of a design; ``report`` is ``report.json`` of the netlist of a readout."""
    if isinstance(config, FrameConfig):
        return frame_readout.sheet_of(config, report)
    if isinstance(config, ClassifierConfig):
        return classifier.sheet_of(config)
    if isinstance(config, MergeConfig | TilesConfig):
        return skin.sheet_of(config)
    return readout.sheet_of(config, report)


def deliver(config: Config, folder: Path, report: Path | None = None, gated: bool = False) -> list[Path]:
    """Write Verilog, constraints, description and datasheet of a design into a folder; return their paths.

    A chip has no datasheet. ``report`` is ``report.json`` of the netlist of a readout; ``gated`` selects clock gates.
    """
    netlist = None
    if report is not None and isinstance(config, ReadoutConfig | FrameConfig):
        netlist = load_report(report, config)
    paths = write(config, folder, gated)
    if isinstance(config, ChipConfig):
        return paths
    sheet = dataclasses.replace(sheet_of(config, netlist), gated=gated)
    return [*paths, *sheet.write(folder)]
