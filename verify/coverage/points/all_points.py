"""Functional coverage points of every design."""

from eskin.board.config import BoardConfig
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import FrameConfig
from eskin.model.tiles.config import MergeConfig, TilesConfig
from eskin.rtl.verilog import Config
from eskin.verify.coverage.points.blocks import board, chip, classifier, frames, lines, merge
from eskin.verify.coverage.points.point import Point
from eskin.verify.coverage.points.readout import readout
from eskin.verify.coverage.points.registers import registers


def points(config: Config | BoardConfig) -> list[Point]:
    """Return the coverage points of a configuration."""
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
