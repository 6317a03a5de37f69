"""The datasheets of all designs that have one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from model.classifier.config import ClassifierConfig
from model.config import ReadoutConfig
from model.frame_config import FrameConfig
from model.tiles.config import MergeConfig, TilesConfig
from rtl.datasheet import classifier, frames, readout, skin
from rtl.datasheet.sheet import Sheet

Described = ReadoutConfig | FrameConfig | ClassifierConfig | MergeConfig
"""Designs that have a datasheet; of a chip readout and classifier have theirs."""


def sheet_of(config: Described, report: dict[str, Any] | None = None) -> Sheet:
    """Return the datasheet of a design.

    Parameters
    ----------
    config : ReadoutConfig, FrameConfig, ClassifierConfig, MergeConfig or TilesConfig
    report : dict, optional
        ``report.json`` of its netlist, of which there are those of readouts alone.
    """
    if isinstance(config, FrameConfig):
        return frames.sheet_of(config, report)
    if isinstance(config, ClassifierConfig):
        return classifier.sheet_of(config)
    if isinstance(config, MergeConfig | TilesConfig):
        return skin.sheet_of(config)
    return readout.sheet_of(config, report)


def write_datasheet(config: Described, folder: Path, report: dict[str, Any] | None = None) -> list[Path]:
    """Write page and pictures into a folder; return their paths."""
    return sheet_of(config, report).write(folder)
