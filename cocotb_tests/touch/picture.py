"""The picture that touch leaves: one scan from texture to class, as the RTL gave it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from cocotb_tests.bench.chip import ChipRun
from cocotb_tests.touch.plan import Plan
from model.events.recording import Recording
from model.figures.scan_to_class import Played, plot_scan
from model.files import read_arrays
from model.textures.presets import preset


def draw(plan: Plan, path: Path) -> Path | None:
    """Draw the first scan with a known class, from texture to class; all below its signals came out of the RTL."""
    for name in plan.names:
        arrays = read_arrays(plan.folder / f"{name}.npz", "a result of touch", "play it again")
        said = json.loads(str(arrays["metadata"]))
        if said["true"] is not None:
            break
    else:
        return None
    network, array = plan.networks[name], plan.material.arrays([name])[name]
    chip, bins, samples = network.chip, said["bins"], plan.samples(name, array)
    run = ChipRun(arrays["taken"], arrays["taken"], arrays["channel"], None, [], arrays["spikes"])
    spikes = np.zeros((bins, chip.classifier.hidden), np.float32)
    spikes[tuple(run.spikes[run.spikes[:, 0] < bins].T)] = 1
    unit = network.weights.notes["output_unit"] / bins if chip.classifier.readout == "membrane" else 1.0
    scanned = bool(plan.material.preset)
    played = Played(
        name=name,
        true=said["classes"][said["true"]],
        label=said["true"],
        tested=name in network.tested,
        scan=preset(plan.material.preset) if scanned else None,
        pixels=plan.image(name, array) if scanned else None,
        recording=Recording(run.events(chip), chip.readout, len(samples) * chip.readout.clocks_per_sample),
        signals=samples / chip.readout.full_scale,
        start_s=0.0,
        step_s=chip.classifier.bin_s,
        spikes=spikes,
        evidence=(arrays["evidence"] * unit).astype(np.float32),
        class_names=tuple(said["classes"]),
        meaning="events, spikes and evidence as the RTL gave them",
    )
    plot_scan(played, path)
    return path
