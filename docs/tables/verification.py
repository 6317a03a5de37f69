"""Tables of proofs, coverage, faults and fuzz tests."""

from itertools import groupby
from typing import Any

from docs.tables.write import Rows, read
from eskin.verify.signoff import PUBLISHED, rows


def evidence(name: str) -> dict[str, Any]:
    """Return a verification report, or a part of it ("report/part")."""
    name, _, part = name.partition("/")
    report = read(f"docs/data/verification/{name}.json")
    return dict(report[part] if part else report)


def signoff() -> Rows:
    """Yield every kind of evidence with its latest result."""
    return rows(PUBLISHED)


def signed_off() -> dict[str, Any]:
    """Return the minutes of the last sign-off, of its longest step, and the name of this step."""
    took = {name: step["seconds"] / 60 for name, step in evidence("signoff/steps").items()}
    longest = max(took, key=lambda name: took[name])
    return {"minutes": sum(took.values()), "longest": longest, "most": took[longest], "soak": took["soak"]}


def proof_mutants() -> dict[str, int]:
    """Return the number of generated mutants, and the number killed by a property."""
    failed = [failed for one in evidence("formal")["hunts"] for failed in one["mutants"].values()]
    return {"generated": len(failed), "killed": sum(map(bool, failed))}


def stages() -> Rows:
    """Yield the verification state of every block."""
    faults_of = evidence("faults")["blocks"]
    for block, found in groupby(evidence("formal")["properties"], key=lambda row: row["block"]):
        properties = list(found)
        proved = sum(row["unbounded"] and not row["problems"] for row in properties)
        mutants = min(row["mutants"] for row in properties)
        modules = ("decay_ticks", "settable_ticks") if block == "decay" else (block,)
        upset = [one for one in faults_of if one["block"] in modules]
        upsets, never = (sum(one[key] for one in upset) for key in ("upsets", "never recovers"))
        stage = "V1" if proved < len(properties) or mutants < 3 else "V3" if upset and not never else "V2"
        tried = [f"{upsets:,}", f"{never:,}"] if upsets else ["no flops" if upset else "not yet", ""]
        yield [block.replace("_", " "), stage, f"{proved} of {len(properties)}", str(mutants), *tried]


def coverage() -> Rows:
    """Yield the coverage of the Verilog by kind."""
    words = {"line": "lines", "branch": "branches", "toggle": "toggles", "condition": "terms of conditions"}
    words |= {"point": "points of the specification"}
    for kind, word in words.items():
        one = evidence("coverage/constructs")[kind]
        yield one | {"word": word, "left": one["total"] - one["reached"] - one["explained"]}


def hostile() -> Rows:
    """Yield the tests with hostile inputs, and the number of runs that confirm the expected effect."""
    cases = evidence("faults")["cases"]
    for name in dict.fromkeys(line["case"] for line in cases):
        lines = [line for line in cases if line["case"] == name]
        good, runs = (sum(line[key] for line in lines) for key in ("as stated", "runs"))
        yield [name, lines[0]["stated"], f"{good} of {runs}"]


def replayed() -> dict[str, int]:
    """Return the number of images that every encoder has encoded in the RTL, and the events of all encoders."""
    runs = evidence("replay")["runs"]
    (images,) = {run["images"] for run in runs}
    return {"images": images, "events": sum(run["events"] for run in runs)}
