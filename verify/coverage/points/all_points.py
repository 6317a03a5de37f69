"""All functional points, by what is built."""

from __future__ import annotations

from board.config import BoardConfig
from model.classifier.chip_config import ChipConfig
from model.classifier.config import ClassifierConfig
from model.config import ReadoutConfig
from model.frame_config import FrameConfig
from model.tiles.config import MergeConfig, TilesConfig
from rtl.verilog import Config
from verify.coverage.points.blocks import frames, lines, merge
from verify.coverage.points.board import board
from verify.coverage.points.classifier import chip, classifier
from verify.coverage.points.point import Point
from verify.coverage.points.readout import readout
from verify.coverage.points.registers import registers


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
