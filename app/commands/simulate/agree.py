"""The command agree: compare float, integer and RTL networks."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from eskin.app.cli import asked_for, echo, printable
from eskin.app.commands import common
from eskin.app.commands.learn.options import output_folder
from eskin.app.options import arg, command, opt, out_folder
from eskin.app.tables import print_table
from eskin.base.errors import InputError
from eskin.base.files import origin, write_json
from eskin.base.progress import bar, reported

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from eskin.snn.exchange.weights import Weights


@command("RTL against model", needs="sim snn", fuzz="good/train/weights.npz --bits 9 -o new")
def agree(
    weights: list[Path] = arg(..., "WEIGHTS.npz...", "trained or imported networks"),
    bits: str = opt("8,7,6,5,4,3,2", "BITS,...", "bits of the weights, 2..8"),
    scans: int = opt(512, "scans of random events", min=1, max=10_000),
    bins: int = opt(256, "time bins of a scan", min=1, max=10_000),
    rate: float = opt(0.3, "largest mean number of events per bin and channel, 0..1"),
    rtl: int = opt(1, "number of scans also computed by the RTL, with the first value of --bits", min=0),
    simulator: str = opt("verilator", "--sim", "verilator or icarus"),
    seed: int = opt(0, "seed of the events", min=0),
    out: Path = out_folder(Path("out/agree"), "DIR", "agreement.json and simulations"),
) -> None:
    """Compare networks in float, in integers and in RTL on random events; exit code 1 if RTL and model differ."""
    from eskin.snn.exchange.weights import config_of, load_weights
    from eskin.snn.experiments.agreement import agreement, random_events

    numbers = _bits(bits)
    if not 0 < rate <= 1:
        raise InputError(f"--rate must be above 0 and at most 1 event per bin and channel, not {rate:g}")
    loaded = {path: load_weights(path) for path in weights}
    output_folder(out, "agreement.json")
    networks: list[dict[str, Any]] = []
    problems, runs = [], 0
    with bar("networks", len(loaded)) as step:
        for number, (path, one) in enumerate(loaded.items()):
            events = random_events(scans, bins, config_of(one.network).inputs, rate, seed)
            found = {"network": path.stem, "bins": bins} | agreement(one, events, numbers)
            if rtl:
                with reported(printable(f"building and simulating {path.stem} for {simulator}")):
                    counts, problem = _in_rtl(one, numbers[0], events[:rtl], simulator, out / str(number))
                found |= {"rtl": counts}
                runs += counts.get("runs", 0)
                problems += [f"{path.stem}: {problem}"] if problem else []
            networks.append(found)
            step()
    write_json(out / "agreement.json", origin(asked_for()) | {"networks": networks})
    print_table(
        "network | bits | same class as in float | 95 % interval",
        [one | point for one in networks for point in one["points"]],
        "{network} | {bits} | {same} of {scans} | {wilson_95[0]:100*.0f} to {wilson_95[1]:100*.0f} %",
    )
    echo(f"result: {out / 'agreement.json'}")
    if rtl:
        sums = {name: sum(one["rtl"].get(name, 0) for one in networks) for name in ("clocks", "events", "bins")}
        exact = ", ".join(f"{count} {name}" for name, count in sums.items())
        common.conclude(
            problems, f"{'FAILED' if problems else 'bit-exact'}: {runs} runs, {exact}, {len(problems)} mismatches"
        )


def _bits(text: str) -> list[int]:
    parts = text.split(",")
    if not all(part in {str(bits) for bits in range(2, 9)} for part in parts) or len(set(parts)) < len(parts):
        raise InputError(f"--bits must list different numbers from 2 to 8, separated by commas, not {text!r}")
    return [int(part) for part in parts]


def _in_rtl(
    weights: Weights, bits: int, events: NDArray[Any], simulator: str, folder: Path
) -> tuple[dict[str, int], str]:
    """Return the counts of the comparison of RTL and model, and the first difference as text."""
    from typing import cast

    from eskin.cocotb_tests.blocks.classifier import play_scans
    from eskin.cocotb_tests.runner.cocotb_runners import Simulator
    from eskin.snn.exchange.integer import Precision, quantise

    made = quantise(weights, Precision(in_bits=bits, rec_bits=bits, out_bits=bits))
    try:
        return dict(play_scans(made, events, cast(Simulator, simulator), folder)), ""
    except AssertionError as mismatch:
        return {}, str(mismatch)
