"""Compare the processor time of whole runs of ``eskin touch`` at this commit and at an earlier commit.

Both commits play the same images with the network of each fold, on one worker, and must report the same events, stalls
and classes. Each commit first builds its simulation programs, one for each network, and plays a single image, which
fills its caches.
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Annotated, Any

import typer
from measure import RESULTS, children_s, write

HERE = Path(__file__).parents[1]
SAME = ("clocks", "events", "bins", "hidden_spikes", "stalls", "overruns", "answers")


PROGRAMS = """
import sys
from pathlib import Path
from eskin.cocotb_tests.touch.plan import plan
plan(None, None, sys.argv[1], int(sys.argv[2]), None, Path("unused")).programs
"""


def run(checkout: Path, *command: str) -> None:
    """Run Python in a checkout."""
    environment = os.environ | {"PYTHONPATH": str(checkout), "OMP_NUM_THREADS": "1"}
    subprocess.run([sys.executable, *command], cwd=checkout, env=environment, check=True, stdout=subprocess.DEVNULL)


def touch(checkout: Path, dataset: Path, images: int) -> tuple[float, dict[str, Any]]:
    """Return the processor seconds and the summary of one run of the command in a checkout."""
    with tempfile.TemporaryDirectory() as out:
        before = children_s()
        options = ["--dataset", str(dataset), "--workers", "1", "--limit", str(images), "-o", out]
        run(checkout, "-m", "eskin", "touch", *options)
        spent = children_s() - before
        (summary,) = Path(out).glob("*/summary.json")
        found = json.loads(summary.read_text())
    return spent, found


def main(
    before: Annotated[Path, typer.Option(help="checkout of an earlier commit")],
    dataset: Annotated[Path, typer.Option(help="texture folder")],
    images: Annotated[int, typer.Option(help="images, evenly spread")] = 240,
    rounds: Annotated[int, typer.Option(help="rounds; both commits play once in each")] = 1,
    out: Annotated[Path, typer.Option("--json", help="result file")] = RESULTS / "touch.json",
) -> None:
    """Measure both commits in turn, and write seconds and ratios to JSON."""
    places = {"before": before.resolve(), "now": HERE}
    for place in places.values():
        run(place, "-c", PROGRAMS, str(dataset.resolve()), str(images))
        touch(place, dataset.resolve(), 1)
    seconds: list[dict[str, float]] = []
    for _ in range(rounds):
        runs = {name: touch(place, dataset.resolve(), images) for name, place in places.items()}
        said = [{key: run[key] for key in SAME} for _, run in runs.values()]
        if said[0] != said[1]:
            raise AssertionError(f"the two commits differ: {said}")
        seconds.append({name: spent for name, (spent, _) in runs.items()})
        print(seconds[-1], flush=True)
    ratios = [run["now"] / run["before"] for run in seconds]
    describe = ["git", "describe", "--always", "--dirty"]
    commit = subprocess.run(describe, cwd=before, capture_output=True, text=True, check=True).stdout.strip()
    totals = {key: said[0][key] for key in SAME[:-1]}
    result = {"before": commit, "images": images, **totals, "seconds": seconds, "ratio": statistics.median(ratios)}
    options = f"--before EARLIER --dataset {dataset.name} --images {images} --rounds {rounds}"
    write(out, "touch", options, {"results": result})


if __name__ == "__main__":
    typer.run(main)
