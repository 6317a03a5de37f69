"""Test that all configurations refuse wrong types, ranges and names with the same sentences."""

import math
from collections.abc import Callable
from typing import Any

import pytest

from eskin.base.errors import InputError
from eskin.board.config import BoardConfig, SerialConfig
from eskin.board.sensor import SensorConfig
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.config import ReadoutConfig
from eskin.skin.recordings.options import Preparation
from eskin.snn.network_config import NetworkConfig
from eskin.snn.training import TrainConfig

NETWORK: dict[str, Any] = {"inputs": 1, "classes": 2}
WRONG: list[tuple[Callable[..., object], dict[str, Any], str]] = [
    (ReadoutConfig, {"rows": "2"}, "rows must be of type int, not '2'"),
    (ClassifierConfig, {"floor": 0.5}, "floor must be of type int or None, not 0.5"),
    (ChipConfig, {"readout": 1, "classifier": 2}, "readout must be of type ReadoutConfig, not 1"),
    (SerialConfig, {"baud": "fast"}, "baud must be of type int, not 'fast'"),
    (BoardConfig, {"chip": 3}, "chip must be of type ChipConfig or None, not 3"),
    (SensorConfig, {"part": "mcp3008", "settle_s": 1}, "settle_s must be in 0..0.01, not 1.0"),
    (Preparation, {"strict": 1}, "--strict must be of type bool, not 1"),
    (Preparation, {"decimal": "dot"}, "--decimal must be one of auto, point, comma, not 'dot'"),
    (Preparation, {"skip_lines": -1}, "--skip-lines must be in 0..1000000, not -1"),
    (NetworkConfig, NETWORK | {"hidden": "9"}, "hidden must be of type int, not '9'"),
    (NetworkConfig, NETWORK | {"readout": "rate"}, "readout must be one of spikes, membrane, not 'rate'"),
    (TrainConfig, {"epochs": 0}, "epochs must be at least 1, not 0"),
    (TrainConfig.from_dict, {"fields": []}, "the fields of a training must be a JSON object, not list"),
    (TrainConfig().replace, {"epoch": 1}, "unknown training field 'epoch'; known fields are "),
]


@pytest.mark.parametrize(("make", "fields", "sentence"), WRONG, ids=[sentence for *_, sentence in WRONG])
def test_a_wrong_value_is_refused(make: Callable[..., object], fields: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InputError) as refused:
        make(**fields)
    assert str(refused.value).startswith(sentence)


def test_a_network_takes_the_text_of_a_float_that_json_lacks() -> None:
    assert NetworkConfig.from_dict(NETWORK | {"floor": "-inf"}).floor == -math.inf
