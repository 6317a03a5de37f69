"""Draw the picture of touch: one scan from texture to class, with the outputs of the RTL."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from eskin.base.files import read_arrays
from eskin.cocotb_tests.bench.chip import ChipRun
from eskin.cocotb_tests.touch.plan import Plan
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.events.recording import Recording
from eskin.skin.figures.scan_to_class import ScanToClass, plot_scan
from eskin.skin.textures.presets import preset


def draw(plan: Plan, summary: dict[str, Any], path: Path) -> Path | None:
    """Draw the first scan with a known class, from texture to class.

    The numbers of each step above the panels are of all that was played.
    """
    for name in plan.names:
        arrays = read_arrays(plan.folder / f"{name}.npz", "a result of touch", "run touch again")
        said = json.loads(str(arrays["metadata"]))
        if said["true"] is not None:
            break
    else:
        return None
    network, samples = plan.networks[name], plan.samples(name)
    chip, bins = network.chip, said["bins"]
    run = ChipRun(arrays["taken"], arrays["taken"], arrays["channel"], None, [], arrays["spikes"])
    spikes = np.zeros((bins, chip.classifier.hidden), np.float32)
    spikes[tuple(run.spikes[run.spikes[:, 0] < bins].T)] = 1
    unit = network.weights.notes["output_unit"] / bins if chip.classifier.readout == "membrane" else 1.0
    scanned = bool(plan.material.preset)
    played = ScanToClass(
        name=name,
        true=said["classes"][said["true"]],
        label=said["true"],
        tested=name in network.notes.tested,
        scan=preset(plan.material.preset, network.notes.wiring) if scanned else None,
        pixels=plan.image(name) if scanned else None,
        recording=Recording(run.events(chip), chip.readout, len(samples) * chip.readout.clocks_per_sample),
        signals=samples / chip.readout.full_scale,
        start_s=0.0,
        step_s=chip.classifier.bin_s,
        spikes=spikes,
        evidence=(arrays["evidence"] * unit).astype(np.float32),
        class_names=tuple(said["classes"]),
        meaning="from the RTL",
        right=summary["right"],
        tests=summary["labelled"],
        numbers=numbers(chip, summary),
    )
    plot_scan(played, path)
    return path


def numbers(chip: ChipConfig, summary: dict[str, Any]) -> dict[str, str]:
    """Return a text for each step from touch to class, with its rates and sizes."""
    readout, classifier = chip.readout, chip.classifier
    seconds = summary["clocks"] / readout.clock_hz
    samples_bps = readout.taxels * readout.sample_rate_hz * readout.sample_bits
    rate_hz = summary["events"] / seconds
    waited = summary["stalls"] / summary["clocks"]
    return {
        "signals": f"{readout.taxels} x {readout.sample_bits} b, {readout.sample_rate_hz:g} Hz: {_bps(samples_bps)}",
        "events": f"all images: {rate_hz:,.0f} a second x {readout.event_bits} b = "
        f"{_bps(rate_hz * readout.event_bits)}, {waited:.1%} of the clocks waiting",
        "hidden": f"all images: {summary['additions'] / seconds / 1e6:.2g} M additions a second, "
        f"{classifier.memory_bits / 8000:.1f} kB of weights of {classifier.rec_bits} b",
        "evidence": f"class at most {summary['latency_clocks']} clocks, "
        f"{1e3 * summary['latency_clocks'] / readout.clock_hz:.2g} ms, after the end of a step",
    }


def _bps(rate: float) -> str:
    return f"{rate / 1e6:.3g} Mb/s" if rate >= 1e6 else f"{rate / 1e3:.3g} kb/s"
