"""Write power results of netlists to the report and to files for the power model."""

from pathlib import Path
from typing import Any

from eskin.base.errors import InputError
from eskin.base.files import write_json
from eskin.flow import programs
from eskin.flow.asic.synthesis import synthesise
from eskin.flow.liberty.library import read
from eskin.flow.power.measure import APART, GLITCH_DELAY_NS, Disagreement, glitches, measure
from eskin.flow.power.scenarios import scenarios
from eskin.flow.wire import PITCH_UM
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import FrameConfig
from eskin.power.readouts import SPIKING

FRAME_RATE_HZ = 200.0
"""Frame rate of stored frame power: above twice 97 Hz, below which textures have 99 % of their power."""


def why_not(config: ReadoutConfig | FrameConfig) -> str:
    """Return the reason why the power of a readout cannot be measured; empty if possible."""
    if missing := programs.absent("iverilog"):
        return missing
    try:
        if not isinstance(config, FrameConfig):
            scenarios(config)
    except InputError as reason:
        return str(reason)
    return ""


def energies(config: ReadoutConfig | FrameConfig, text: str, library: Path) -> dict[str, Any]:
    """Return the power of a netlist without wires, in the format of the power model.

    ``power`` holds the stretches, ``with_wires`` all of it with estimated wires, blocks left out, or why there is none.

    ``text``: gated netlist, Verilog.
    Raises Mismatch if netlist and model differ.
    Raises Disagreement if the two methods differ too much.
    """
    bare, wired = measure(config, text, read(library), (0.0, PITCH_UM))
    for stretch in wired.get("scenarios", {}).values():
        del stretch["blocks"]
    return bare | {"power": bare.pop("scenarios"), "with_wires": wired}


def designs(config: ReadoutConfig) -> dict[str, ReadoutConfig | FrameConfig]:
    """Return the readouts that the power model compares: analog LCS, analog N-LCS and frames."""
    slow = config.replace(encoding="lcs", frontend="digital", link="stream", sample_rate_hz=FRAME_RATE_HZ)
    return {
        **{name: config.replace(encoding=name, frontend="analog") for name in sorted(SPIKING)},
        "frame": FrameConfig(readout=slow),
    }


def name_of(result: dict[str, Any]) -> str:
    """Return the file name of a result."""
    front = "".join(f"-{result['frontend']}" if result["frontend"] else "")
    wires = "-wires" if result["pitch_um"] else ""
    return f"{result['readout']}{front}-{result['rows']}x{result['columns']}-{result['process']}{wires}"


def write(
    chosen: dict[str, ReadoutConfig | FrameConfig],
    library: Path,
    folder: Path,
    origin: dict[str, str],
) -> list[dict[str, Any]]:
    """Measure designs with and without wires, and write a file for each; return the results."""
    whole, results = read(library), []
    folder.mkdir(parents=True, exist_ok=True)
    for config in chosen.values():
        made = synthesise(config, whole)
        for result in measure(config, made.text, whole, (0.0, PITCH_UM)):
            if APART in result:
                raise Disagreement(result[APART])
            write_json(folder / f"{name_of(result)}.json", origin | result)
            results.append(result)
    return results


def write_glitches(config: ReadoutConfig, library: Path, folder: Path, origin: dict[str, str]) -> dict[str, float]:
    """Measure the energy of glitches, write a file, and return the relative increase per event by scenario."""
    whole = read(library)
    found = glitches(config, synthesise(config, whole).text, whole)
    shares = {name: found["delay"][name] / energy - 1 for name, energy in found["no_delay"].items() if name != "idle_w"}
    about = {"readout": config.encoding, "frontend": config.frontend, "rows": config.rows, "columns": config.columns}
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"glitches-{config.encoding}-{config.frontend}-{config.rows}x{config.columns}-{whole.name}.json"
    write_json(
        path, origin | about | {"process": whole.name, "cell_delay_ns": GLITCH_DELAY_NS, "added": shares} | found
    )
    return shares


def write_classifier(
    config: ReadoutConfig, weights: Path, path: Path, out: Path, said: dict[str, Any]
) -> dict[str, Any]:
    """Write the energies of a classifier's logic to OUT/classifier-LIB.json."""
    from eskin.flow.power.classifier import measure as measure_classifier
    from eskin.model.classifier.chip_config import ChipConfig
    from eskin.model.classifier.file import IntegerWeights

    network = IntegerWeights.load(weights).network
    chip = ChipConfig(readout=config, classifier=network.config)
    result = said | measure_classifier(chip, network, read(path))
    out.mkdir(parents=True, exist_ok=True)
    write_json(out / f"classifier-{path.stem}.json", result)
    return result
