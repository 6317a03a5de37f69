"""``python -m tests.fuzz CASES``: a long campaign; keeps what it counted in docs/data/verification/fuzz.json."""

from __future__ import annotations

import datetime
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from model.files import write_json

ROOT = Path(__file__).parents[2]
KEPT = ROOT / "docs" / "data" / "verification" / "fuzz.json"


def main() -> None:
    """Run the campaign, and keep its counts if nothing was wrong."""
    if len(sys.argv) != 2 or not sys.argv[1].isdecimal() or int(sys.argv[1]) < 100:
        sys.exit("usage: python -m tests.fuzz CASES, at least 100 of files and as many of options")
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"ESKIN_FUZZ": sys.argv[1], "ESKIN_FUZZ_COUNTS": folder}
        code = subprocess.call([sys.executable, "-m", "pytest", "-q", "tests/fuzz"], cwd=ROOT, env=environment)
        if code:
            sys.exit(code)
        counts = {name: json.loads((Path(folder) / f"fuzz-{name}.json").read_text()) for name in ("files", "options")}
    commit = subprocess.run(["git", "describe", "--always", "--dirty"], cwd=ROOT, capture_output=True, text=True).stdout
    write_json(
        KEPT,
        {
            "command": f"python -m tests.fuzz {sys.argv[1]}",
            "commit": commit.strip(),
            "date": datetime.date.today().isoformat(),
            **counts,
        },
    )
    print(f"kept {KEPT.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
