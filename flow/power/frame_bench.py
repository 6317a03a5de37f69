"""Simulate the netlist of the frame readout, active and idle, and compare every output with the model."""

from pathlib import Path

import numpy as np

from eskin.flow import programs
from eskin.flow.gatesim.flat_netlist import FlatNetlist
from eskin.flow.power.activity import DUMP, HALF_NS, Activity, read_dump
from eskin.flow.power.event_bench import Mismatch
from eskin.flow.power.scenarios import IDLE, TEXTURE, texture_samples
from eskin.model.frame import FrameModel, Inputs, Outputs
from eskin.model.frame_config import FrameConfig
from eskin.model.frame_words import adc_code

FRAMES = 2
IDLE_CLOCKS = 400


def play(config: FrameConfig, netlist: FlatNetlist, cells: str, folder: Path) -> dict[str, tuple[Activity, int]]:
    """Return the net activity of the frame readout, idle and active, with the number of samples."""
    frames = FRAMES * config.clocks_per_frame
    return {
        IDLE: (_run(config, netlist, cells, folder, 0, IDLE_CLOCKS), 0),
        TEXTURE: (_run(config, netlist, cells, folder, FRAMES, frames), FRAMES * config.taxels),
    }


def _run(config: FrameConfig, netlist: FlatNetlist, cells: str, folder: Path, frames: int, clocks: int) -> Activity:
    """Simulate frames and return the activity of the nets in a window."""
    inputs, outputs = _traces(config, frames, clocks)
    widths = {port.name: len(port.nets) for port in netlist.ports}
    (folder / "inputs.txt").write_text("\n".join(_words(inputs, Inputs._fields, widths)))
    (folder / "outputs.txt").write_text("\n".join(_words(outputs, Outputs._fields, widths)))
    given, seen = ([name for name in one._fields if name in widths] for one in (Inputs, Outputs))
    bench = programs.filled(  # applies the inputs, and counts clocks with a wrong output
        "frames.v",
        given=given,
        seen=seen,
        widths=widths,
        wide=sum(widths[name] for name in given),
        broad=sum(widths[name] for name in seen),
        clocks=clocks,
        top=netlist.top,
        ports=[port.name for port in netlist.ports],
        file=DUMP,
    )
    said = programs.icarus([netlist.verilog(), cells, bench], "play", folder)
    if int(said.split()[-1]):
        raise Mismatch(f"the netlist differs from the frame readout's model in {said.split()[-1]} clocks")
    return read_dump(folder / DUMP, HALF_NS, clocks, netlist.nets)


def _traces(config: FrameConfig, frames: int, clocks: int) -> tuple[list[Inputs], list[Outputs]]:
    """Return the inputs and the expected outputs of every clock."""
    codes = adc_code(config, texture_samples(config.readout, max(frames, 1))) & ((1 << config.resolution) - 1)
    model = FrameModel(config)
    inputs, outputs = [], []
    done_at, code = -1, 0
    for clock in range(clocks):
        frame, since = divmod(clock, config.clocks_per_frame)
        found = model.outputs
        given = Inputs(int(since == 0 and frame < frames), int(clock == done_at), code, 1)
        if found.adc_start:
            done_at, code = clock + config.adc_clocks, int(codes[frame, model.taxel])
        inputs.append(given)
        outputs.append(found)
        model.clock(given)
    return inputs, outputs


def _words(rows: list[Inputs] | list[Outputs], names: tuple[str, ...], widths: dict[str, int]) -> list[str]:
    present = [(number, widths[name]) for number, name in enumerate(names) if name in widths]
    return ["".join(format(int(np.uint64(row[number])), f"0{width}b") for number, width in present) for row in rows]
