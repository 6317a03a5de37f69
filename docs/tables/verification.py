"""Tables of proofs, coverage, faults and soak tests, and the sign-off page."""

from itertools import groupby
from typing import Any

from docs.tables.write import Rows, read, source, table

EVIDENCE = {
    "proved": ("formal", "properties of the RTL, for any number of clocks"),
    "second solver": ("crossproof", "the proved properties; z3 searches them again, with and without planted bugs"),
    "covered": ("coverage", "lines, branches and toggles of the Verilog; points of the specification"),
    "faults": ("faults", "upsets of every flop, and hostile inputs"),
    "soaked": ("soak", "random configurations, RTL compared with model"),
    "hostile input": ("fuzz", "damaged files and out-of-range options"),
}
"""Reports in docs/data/verification that the sign-off lists, by name, with a description."""


def evidence(name: str) -> dict[str, Any]:
    """Return a verification report, or a part of it ("report/part")."""
    name, _, part = name.partition("/")
    report = read(f"docs/data/verification/{name}.json")
    return dict(report[part] if part else report)


ATTACKS = {
    "files": "damaged files",
    "options": "values of options",
    "liberty": "cell libraries",
    "boards": "packets of a board, with right checksums",
    "state": "stored progress of long runs",
    "outputs": "output paths",
    "folders": "folders with special files",
}
"""Attacks of the fuzz campaign, by their name in its data."""


def signoff() -> Rows:
    """Yield every kind of evidence with its latest result."""
    for kind, (name, what) in EVIDENCE.items():
        report = evidence(name)
        if name == "fuzz":
            cases, wrong = (sum(report[of][key] for of in ATTACKS if of in report) for key in ("cases", "wrong"))
            report["result"] = f"fuzz: {cases:,} cases, {wrong} wrong"
        yield report | {"kind": kind, "what": what}


def proofs() -> None:
    """Print the properties of every block, and the number of mutants that violate each property."""
    report = evidence("formal")
    for row in report["properties"]:
        row["block"], row["property"] = (row[name].replace("_", " ") for name in ("block", "property"))
        row["sizes"] = len(row["sizes"])
        row["length"] = "any" if row["unbounded"] else "not proved"
        row["mutants"] = row["mutants"] or "not run"
    table(
        "block | name | property | configurations | proved for how many clocks | mutants that violate the property",
        report["properties"],
        "{block} | {property} | {meaning} | {sizes} | {length} | {mutants}",
    )
    report["commit"] = report["commit"].replace("; the ", ", for the ")
    proved = sum(row["unbounded"] and not row["problems"] for row in report["properties"])
    source(report, f". The solvers proved {proved} of {len(report['properties'])} properties for any number of clocks")


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
    for kind, word in words.items():
        one = evidence("coverage/constructs")[kind]
        yield one | {"word": word, "left": one["total"] - one["reached"] - one["explained"]}


def unreached() -> Rows:
    """Return the reasons for uncovered Verilog."""
    reasons = sorted(evidence("coverage")["reasons"].items(), key=lambda item: -item[1]["constructs"])
    return [[reason, f"{one['constructs']:,}", "proved" if one["proved"] else "argued"] for reason, one in reasons]


def faults() -> Rows:
    """Yield the outcomes of bit flips by block and stimulus."""
    report = evidence("faults")
    outcomes = ("nothing", "own events", "others moved", "others changed", "until written")
    by: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for line in (line for line in report["blocks"] if line["upsets"]):
        by.setdefault((line["block"], line["trial"].split(", ")[-1]), []).append(line)
    blocks = list(dict.fromkeys(line["block"] for line in report["blocks"]))
    for (block, course), lines in sorted(by.items(), key=lambda item: blocks.index(item[0][0])):
        total, never = (sum(line[name] for line in lines) for name in ("upsets", "never recovers"))
        shares = [f"{sum(line.get(name, 0) for line in lines) / total:.1%}" for name in outcomes]
        worst = ", ".join(str(max(line[name] for line in lines)) for name in ("lost", "added"))
        counted = course in ("calm", "loaded")  # other courses compare events and do not count them
        off = max((line.get("off", -1) for line in lines), default=-1)
        more = [worst if counted else "", str(off) if off >= 0 else ""]
        yield [block.replace("_", " "), course, f"{total:,}", *shares, *more, str(never)]


def hostile() -> Rows:
    """Yield the tests with hostile inputs, and the number of runs that confirm the expected effect."""
    cases = evidence("faults")["cases"]
    for name in dict.fromkeys(line["case"] for line in cases):
        lines = [line for line in cases if line["case"] == name]
        good, runs = (sum(line[key] for line in lines) for key in ("as stated", "runs"))
        yield [name, lines[0]["stated"], str(len(lines)), f"{good} of {runs}"]


def soak() -> None:
    """Print the totals of the soak test."""
    report = evidence("soak")
    table(
        "clocks | events | configurations | simulations | most taxels | hours | mismatches",
        [report | {"hours": report["seconds"] / 3600}],
        "{clocks:,} | {events:,} | {configurations:,} | {runs:,} | {most_taxels:,} | {hours:.1f} | {mismatches}",
    )
    by = "; ".join(", ".join(f"{name} {count}" for name, count in counts.items()) for counts in report["by"].values())
    source(report, f". Configurations: {by}")


def fuzz() -> None:
    """Print the fuzz campaign: inputs and outcomes."""
    report = evidence("fuzz")
    table(
        "input | cases | refused in one sentence | command finished | wrong behaviour",
        [report[name] | {"text": text} for name, text in ATTACKS.items() if name in report],
        "{text} | {cases:,} | {refused:,} | {right or different:,} | {wrong:,}",
    )
    commands = {*report["files"]["by command"], *report["options"]["by command"]}
    source(report, f": {len(report['files']['by reader'])} kinds of files, {len(commands)} commands")


def replayed() -> dict[str, int]:
    """Return the number of images that every encoder has encoded in the RTL, and the events of all encoders."""
    runs = evidence("replay")["runs"]
    (images,) = {run["images"] for run in runs}
    return {"images": images, "events": sum(run["events"] for run in runs)}
