"""The commands cache and counts: recorded scans (docs/guide/classifier.md)."""

import itertools
from pathlib import Path
from typing import Any

from eskin.app.cli import command_line, echo
from eskin.app.commands import common
from eskin.app.commands.learn.options import BinSeconds, Preset, Tau
from eskin.app.options import LEAKY, opt, out_file
from eskin.base.errors import InputError
from eskin.base.files import origin, write_json
from eskin.base.progress import bar
from eskin.model.config import ReadoutConfig
from eskin.model.encoders import registry


def cache(clear: bool = opt(False, "--clear", "remove all recorded scans")) -> None:
    """Print the number of cached scans and their folder, or remove them with --clear."""
    from eskin.base import cache as place
    from eskin.snn.data import cache as scans

    if clear:
        print(f"removed {scans.clear()} recorded scans from {place.folder()}")
        return
    entries, size = scans.size()
    print(
        f"{place.folder()}: {entries} recorded scans, {size / 1e6:.1f} MB of at most {scans.LIMIT_BYTES / 1e6:.0f} MB"
    )
    if place.usable("scans") is None:
        print("the folder is not used: it cannot be written, or other users own it or can write to it")


def counts(
    points: str = opt("nlcs:6,nlcs:8,nlcs:10", "ENCODER:N,...", "encoders with resolution"),
    preset: Preset = "paper",
    tau: Tau = None,
    dataset: common.Textures = None,
    bin_s: BinSeconds = None,
    out: Path | None = out_file(None, "FILE", "JSON file for the results"),
) -> None:
    """Compare the event counts of several resolutions of an encoder on the same scans.

    Prints the share of empty bins, and correlation and ratio of the counts.
    """
    from eskin.snn.data.bins import BinConfig
    from eskin.snn.data.scans import empty_bins, likeness
    from eskin.snn.experiments.experiment import Experiment
    from eskin.snn.experiments.settings import parse_points

    chosen = parse_points(points)
    if unfit := [readout for readout, _ in chosen if readout not in registry.NAMES]:
        raise InputError(f"--points takes event encoders ({', '.join(registry.NAMES)}), not {unfit[0]}")
    if tau is not None and not {readout for readout, _ in chosen} & set(LEAKY):
        raise InputError(
            f"--tau is the leak of {' or '.join(LEAKY)}, and --points has none of these encoders; leave --tau out"
        )
    bins = BinConfig() if bin_s is None else BinConfig(bin_s=bin_s)
    found = {}
    for readout, bits in chosen:
        config = ReadoutConfig.from_dict({"encoding": readout, "resolution": int(bits)})
        tau_s = tau if config.encoder.leaks else None
        made = Experiment(dataset=dataset, preset=preset, readout=config, tau_s=tau_s, bins=bins)
        with bar(f"recording {readout}:{bits}") as step:
            found[f"{readout}:{bits}"] = made.data(step)
    result: dict[str, Any] = origin(command_line()) | {
        "empty": {name: empty_bins(data) for name, data in found.items()},
        "pairs": [],
    }
    for name, data in found.items():
        print(f"{name}: {result['empty'][name]:.1%} of the bins are empty, {data.rate_hz:,.0f} events/s")
    for one, other in itertools.combinations(found, 2):
        if one.partition(":")[0] != other.partition(":")[0]:
            continue
        like = likeness(found[one], found[other])
        result["pairs"].append({"first": one, "second": other} | like)
        print(f"{one} and {other}: correlation of the counts {like['correlation']:.4f}, ratio {like['ratio']:.2f}")
    if out is not None:
        write_json(out, result)
        echo(f"result: {out}")
