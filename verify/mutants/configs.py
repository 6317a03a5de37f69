"""Draw random configurations in which an equivalent mutant must behave like the original.

In a copy of the checkout, this file runs as a program that writes their RTLIL.
"""

import json
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from eskin.base.errors import InputError
from eskin.cocotb_tests.bench.draw import Draw
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.encoders.registry import NAMES
from eskin.model.frame_config import FrameConfig
from eskin.model.tiles.config import MergeConfig, TilesConfig
from eskin.rtl.block import RtlilModules
from eskin.rtl.verilog import Config, top_block

COUNT = 16
"""Number of configurations per file."""

SET: dict[str, dict[str, Any]] = {
    "link": {"link": "four_phase"},
    "window": {"encoding": "cw-lcs"},
    "decay": {"encoding": "nlcs", "registers": "none"},
    "registers": {"registers": "spi"},
    "encoders.fields": {"fields": "both", "frontend": "digital"},
    "registers.decay": {"registers": "spi", "encoding": "nlcs", "leak_period": 20},
}
"""Fixed fields of configurations that use a file."""

CLASSIFIER: dict[str, Sequence[Any]] = {
    "inputs": range(1, 7),
    "hidden": range(1, 10),
    "classes": range(1, 5),
    "lanes": (1, 2, 4),
    "clocks_per_bin": range(5, 50),
    **dict.fromkeys(("in_bits", "rec_bits", "out_bits", "bias_bits"), range(2, 9)),
    **dict.fromkeys(("in_shift", "rec_shift", "bias_shift", "out_shift", "out_bias_shift"), range(4)),
    **dict.fromkeys(("leak_shift", "out_leak_shift"), range(4)),
    **dict.fromkeys(("membrane_bits", "output_bits"), range(9, 20)),
    "evidence_bits": range(8, 20),
    **dict.fromkeys(("threshold", "out_threshold"), range(1, 200)),
    **dict.fromkeys(("floor", "out_floor"), (None, -7, 0)),
    "neuron_reset": ("zero", "subtract"),
    "readout": ("spikes", "membrane"),
    "reset": ("sync", "async"),
}
"""Values of the fields of a classifier."""


@cache
def configs(file: str, seed: int) -> tuple[Config, ...]:
    """Return random configurations that use a given file."""
    name = ".".join(Path(file).with_suffix("").parts[1:])
    rng = np.random.default_rng([seed, sum(map(ord, name))])
    found: list[Config] = []
    while len(found) < COUNT:
        try:
            found.append(_one(name, rng))
        except InputError:  # parts that do not fit each other
            continue
    return tuple(found)


def _one(file: str, rng: np.random.Generator) -> Config:
    if file.startswith("classifier") and file != "classifier.chip":
        return _classifier(rng)
    fixed = SET.get(file, SET.get(file.partition(".")[0], {}))
    if (encoding := file.removeprefix("encoders.").replace("_", "-")) in NAMES:
        fixed = {"encoding": encoding}
    if file.startswith("tiles") or file == "classifier.chip":
        fixed = {"link": "stream", "registers": "none", "fields": "own"}
    readout = Draw(int(rng.integers(1 << 30)), set=fixed, most_taxels=9).config
    if file == "frame":
        bits = int(rng.integers(readout.resolution, 33))
        return FrameConfig(
            readout=readout.replace(registers="none", fields="own"), word_bits=bits, settle_clocks=_of(rng, 1, 2, 5)
        )
    if file.startswith("tiles"):
        skin = TilesConfig.of(readout, int(rng.integers(1, 4)), int(rng.integers(1, 4)))
        return MergeConfig(skin) if file == "tiles.merge" else skin
    if file == "classifier.chip":
        inputs = readout.taxels * (1 + int(rng.integers(2)))
        classifier = _classifier(rng).replace(inputs=inputs, reset=readout.reset, clocks_per_bin=400)
        return ChipConfig(readout=readout, classifier=classifier.replace(bin_s=400 / readout.clock_hz))
    return readout


def _of(rng: np.random.Generator, *values: Any) -> Any:
    return values[rng.integers(len(values))]


def _classifier(rng: np.random.Generator) -> ClassifierConfig:
    return ClassifierConfig.from_dict({name: _of(rng, *values) for name, values in CLASSIFIER.items()})


def designs(file: str, seed: int, count: int) -> dict[str, dict[str, str]]:
    """Return the RTLIL of all modules by configuration and name; empty if the generator raises an error."""
    found: dict[str, dict[str, str]] = {}
    for config in configs(file, seed)[:count]:
        made = RtlilModules(config.reset == "async")
        try:
            made.add(top_block(config))
        except Exception:  # a mutant may raise anything
            made.modules = {}
        found[f"{type(config).__name__} {config.to_dict()}"] = made.modules
    return found


if __name__ == "__main__":
    file, seed, count, out = sys.argv[1:]
    Path(out).write_text(json.dumps(designs(file, int(seed), int(count))))
