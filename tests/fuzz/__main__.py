"""Long fuzz campaign: ``python -m tests.fuzz CASES`` stores counts in docs/data/verification/fuzz.json.

A piece is a process of its own with a seed of its own. What is counted stands in out/fuzz, so that a campaign that was
stopped goes on where it was, and pieces in which something was wrong run again once it is mended.
"""

import json
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

from eskin.base.files import origin, write_json
from tests.fuzz.attacks import ATTACKS

ROOT = Path(__file__).parents[2]
KEPT = ROOT / "docs" / "data" / "verification" / "fuzz.json"
WORK = ROOT / "out" / "fuzz"
PIECE = 200
"""Cases of each attack in a piece."""


def main() -> None:
    """Run the remaining pieces, and write the totals if no case failed."""
    if len(sys.argv) != 2 or not sys.argv[1].isdecimal() or int(sys.argv[1]) < PIECE:
        sys.exit(f"usage: python -m tests.fuzz CASES, at least {PIECE}, which are run of each of: {', '.join(ATTACKS)}")
    pieces = [WORK / f"piece-{number:04d}" for number in range(int(sys.argv[1]) // PIECE)]
    bad = [piece.name for number, piece in enumerate(pieces) if not (counted(piece) or run(piece, number))]
    if bad:
        sys.exit(f"something was wrong in {', '.join(bad)}: see log.txt and out.txt there")
    sums: dict[str, Any] = {name: {} for name in ATTACKS}
    for piece in pieces:
        for name in ATTACKS:
            add(sums[name], json.loads((piece / f"fuzz-{name}.json").read_text()))
    write_json(KEPT, origin(f"python -m tests.fuzz {len(pieces) * PIECE}") | sums)
    print(f"kept {KEPT.relative_to(ROOT)}")


def counted(piece: Path) -> bool:
    """Return True if a piece has finished without failure."""
    files = [piece / f"fuzz-{name}.json" for name in ATTACKS]
    return all(file.is_file() and json.loads(file.read_text())["wrong"] == 0 for file in files)


def run(piece: Path, number: int) -> bool:
    """Run a piece and return True if it succeeded; log.txt ends with its last case."""
    piece.mkdir(parents=True, exist_ok=True)
    (piece / "log.txt").unlink(missing_ok=True)
    environment = os.environ | {"ESKIN_FUZZ": f"{PIECE} {number} {piece}"}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "tests/fuzz/test_campaign.py", "-k",
               "attacks"]  # fmt: skip
    with (piece / "out.txt").open("w") as out:
        code = subprocess.call(command, cwd=ROOT, env=environment, stdout=out, stderr=subprocess.STDOUT)
    print(f"{piece.name}: {'nothing wrong' if code == 0 else f'wrong, exit code {code}'}", flush=True)
    return code == 0 and counted(piece)


def add(sums: dict[str, Any], counts: dict[str, Any]) -> None:
    """Add the counts of a piece, by name or by group and name, to their sums."""
    for name, value in counts.items():
        if isinstance(value, dict):
            sums[name] = dict(sorted((Counter(sums.get(name)) + Counter(value)).items()))
        else:
            sums[name] = sums.get(name, 0) + value


if __name__ == "__main__":
    main()
