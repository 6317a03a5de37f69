"""All functional points, by what is built."""

from __future__ import annotations

from flow.coverage.points.blocks import frames, lines, merge
from flow.coverage.points.board import board
from flow.coverage.points.classifier import chip, classifier
from flow.coverage.points.point import Point
from flow.coverage.points.readout import readout
from flow.coverage.points.registers import registers
from model.board.config import BoardConfig
from model.classifier.chip_config import ChipConfig
from model.classifier.config import ClassifierConfig
from model.config import ReadoutConfig
from model.frame_config import FrameConfig
from model.tiles.config import MergeConfig, TilesConfig
from rtl.verilog import Config


def points(config: Config | BoardConfig) -> list[Point]:
    """Return the points of a configuration."""
    if isinstance(config, BoardConfig):
        return list(board(config))
    if isinstance(config, TilesConfig):  # a readout too, of tiles
        return [*merge(config), *(lines(config) if config.relays else ())]
    if isinstance(config, ReadoutConfig):
        return list(registers(config) if config.registers == "spi" else readout(config))
    if isinstance(config, FrameConfig):
        return list(frames(config))
    if isinstance(config, ClassifierConfig):
        return list(classifier(config))
    if isinstance(config, ChipConfig):
        return list(chip(config))
    assert isinstance(config, MergeConfig)
    return list(merge(config.skin))
