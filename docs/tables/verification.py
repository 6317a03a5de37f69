"""Proofs, faults, soak and the sign-off page."""

from __future__ import annotations

from typing import Any

from docs.tables.written import ENCODERS, ROOT, markdown, read, table


@table
def fuzz() -> str:
    """The fuzz campaign: what was tried and how it ended."""
    kept = read("docs/data/verification/fuzz.json")
    rows = [
        [text, *(f"{kept[name][key]:,}" for key in ("cases", "refused", "right or different", "wrong"))]
        for name, text in (("files", "damaged files"), ("options", "values of options"))
    ]
    by = kept["files"]["by reader"], kept["files"]["by command"], kept["options"]["by command"]
    readers, commands = len(by[0]), len({*by[1], *by[2]})
    said = (
        f"`{kept['command']}`, commit {kept['commit']}, {kept['date']}: {readers} kinds of files, {commands} commands."
    )
    return markdown(["", "cases", "refused in a sentence", "done", "wrong"], rows) + f"\n{said}\n"


@table
def proofs() -> str:
    """What is proved of every block, and how many planted bugs each property has noticed."""
    report = read("docs/data/verification/formal.json")
    rows = [
        [
            row["block"].replace("_", " "),
            row["property"].replace("_", " "),
            row["meaning"],
            str(len(row["sizes"])),
            "any" if row["unbounded"] else "not proved",
            str(len(row["mutants_caught"]) or "not run"),
        ]
        for row in report["properties"]
    ]
    head = ["block", "property", "", "configurations", "length of a run", "planted bugs noticed"]
    return f"{markdown(head, rows)}\n`{report['command']}`, {report['commit']}, {report['date']}: {report['result']}.\n"


EVIDENCE = {
    "proved": ("formal", "properties of the RTL, runs of any length"),
    "proved, again": ("crossproof", "the same properties, searched by a second solver, bugs planted"),
    "covered": ("coverage", "RTL lines, branches, toggles; points of the specification"),
    "killed": ("mutants", "automatic mutants of the RTL that the tests notice"),
    "killed, model": (
        "mutants/model_and_snn",
        "a sample of mutants of `model/` and `snn/`, by the tests of their files",
    ),
    "faults": ("faults", "upsets of every flop, and hostile surroundings"),
    "soaked": ("soak", "clocks of random configurations, RTL against model"),
    "hostile input": ("fuzz", "damaged files and absurd options"),
}
"""What is signed off, each with the name of its report in docs/data/verification, and what it is."""


def evidence(name: str) -> dict[str, Any] | None:
    """Return a report of the verification, or a part of one ("report/part"); None if there is none."""
    name, _, part = name.partition("/")
    path = f"docs/data/verification/{name}.json"
    if not (ROOT / path).is_file():
        return None
    kept = dict(read(path))
    return kept.get(part) if part else kept


@table
def signoff() -> str:
    """Every kind of evidence with its last result; where there is none the line says so."""
    rows = []
    for kind, (name, what) in EVIDENCE.items():
        kept = evidence(name)
        if kept is None:
            rows.append([kind, what, "**not yet**", "", "", ""])
            continue
        result = kept["result"] if name != "fuzz" else _fuzz_result(kept)
        rows.append([kind, what, result, f"`{kept['command']}`", kept["commit"], kept["date"]])
    return markdown(["", "what", "last result", "command", "commit", "date"], rows)


def _fuzz_result(kept: dict[str, Any]) -> str:
    cases, wrong = (sum(kept[kind][key] for kind in ("files", "options")) for key in ("cases", "wrong"))
    return f"fuzz: {cases:,} cases, {wrong} wrong"


@table
def stages() -> str:
    """How far every block is."""
    proved: dict[str, list[dict[str, Any]]] = {}
    for row in read("docs/data/verification/formal.json")["properties"]:
        proved.setdefault(row["block"], []).append(row)
    faults = evidence("faults") or {"blocks": []}
    rows = []
    for block, properties in proved.items():
        open_ones = sum(not row["unbounded"] or bool(row["problems"]) for row in properties)
        bugs = min(len(row["mutants_caught"]) for row in properties)
        upset = [one for one in faults["blocks"] if one["block"] == block]
        upsets, never = (sum(one[key] for one in upset) for key in ("upsets", "never recovers"))
        stage = "V1" if open_ones or bugs < 3 else "V3" if upsets and not never else "V2"
        rows.append(
            [
                block.replace("_", " "),
                stage,
                f"{len(properties) - open_ones} of {len(properties)}",
                str(bugs),
                f"{upsets:,}" if upsets else "not yet",
                f"{never:,}" if upsets else "",
            ]
        )
    head = ["block", "stage", "properties proved", "bugs seen by each, at least", "upsets tried", "never recovers"]
    return markdown(head, rows)


def _not_yet() -> str:
    return "Not run yet.\n"


@table
def faults() -> str:
    """What came of the upsets, by block and course."""
    kept = evidence("faults")
    if kept is None:
        return _not_yet()
    outcomes = ("nothing", "own events", "others moved", "others changed", "until written", "never recovers")
    rows = []
    by: dict[str, dict[str, list[dict[str, Any]]]] = {}
    for line in kept["blocks"]:
        by.setdefault(line["block"], {}).setdefault(line["trial"].split(", ")[-1], []).append(line)
    for block, courses in by.items():
        for course, lines in courses.items():
            total = sum(line["upsets"] for line in lines)
            shares = [f"{sum(line.get(name, 0) for line in lines) / total:.1%}" for name in outcomes[:-1]]
            never = str(sum(line[outcomes[-1]] for line in lines))
            counts = course in ("calm", "loaded")  # of events, which elsewhere are compared and not counted
            worst = f"{max(line['lost'] for line in lines)}, {max(line['added'] for line in lines)}" if counts else ""
            rows.append([block.replace("_", " "), course, f"{total:,}", *shares, worst, never])
    head = ["upset in", "course", "upsets", *outcomes[:-1], "most lost, added", outcomes[-1]]
    said = f"`{kept['command']}`, {kept['commit']}, {kept['date']}: {kept['result']}.\n"
    return f"{markdown(head, rows)}\n{said}"


@table
def hostile() -> str:
    """Hostile surroundings, what is stated of them, and in how many runs it was so."""
    kept = evidence("faults")
    if kept is None:
        return _not_yet()
    rows = []
    for name in dict.fromkeys(line["case"] for line in kept["cases"]):
        lines = [line for line in kept["cases"] if line["case"] == name]
        good, runs = (sum(line[key] for line in lines) for key in ("as stated", "runs"))
        rows.append([name, lines[0]["stated"], str(len(lines)), f"{good} of {runs}"])
    return markdown(["surroundings", "what happens", "readouts", "runs as stated"], rows)


@table
def parity() -> str:
    """How much of a taxel a single flop is, in netlists of real cells."""
    rows = []
    for name, text in (
        ("lcs-digital", "LCS, digital"),
        ("lcs-analog", "LCS, analog"),
        ("nlcs-digital", "N-LCS, digital"),
    ):
        netlist = read(f"docs/data/asic/{name}-8x8-ihp.json")
        taxels = netlist["configuration"]["rows"] * netlist["configuration"]["columns"]
        flops = netlist["flops"] / taxels
        rows.append([text, f"{flops:.1f}", f"{netlist['sequential_area_share'] / flops:.1%}"])
    return markdown(["8 x 8 taxels, IHP 130 nm", "flops per taxel", "one flop, of a taxel's area"], rows)


@table
def soak() -> str:
    """What was soaked."""
    kept = evidence("soak")
    if kept is None:
        return _not_yet()
    head = ["clocks", "events", "configurations", "runs", "taxels, at most", "hours", "mismatches"]
    row = [f"{kept[name]:,}" for name in ("clocks", "events", "configurations", "runs", "most_taxels")]
    row += [f"{kept['seconds'] / 3600:.1f}", str(kept["mismatches"])]
    by = "; ".join(", ".join(f"{name} {count}" for name, count in counts.items()) for counts in kept["by"].values())
    said = f"`{kept['command']}`, {kept['commit']}, {kept['date']}. Configurations: {by}.\n"
    return f"{markdown(head, [row])}\n{said}"


@table
def coverage() -> str:
    """What of the Verilog was reached, by kind."""
    kept = evidence("coverage")
    if kept is None:
        return _not_yet()
    words = {"line": "lines", "branch": "branches", "toggle": "toggles", "condition": "terms of conditions"}
    rows = []
    for kind, word in words.items():
        line = kept["constructs"][kind]
        left = line["total"] - line["reached"] - line["explained"]
        rows.append([word, *(f"{line[key]:,}" for key in ("total", "reached", "explained")), str(left)])
    head = ["", "in all", "reached", "explained", "neither"]
    said = f"`{kept['command']}`, {kept['commit']}, {kept['date']}: {kept['result']}; {len(kept['runs'])} runs.\n"
    return f"{markdown(head, rows)}\n{said}"


@table
def unreached() -> str:
    """Why some of the Verilog is never reached."""
    kept = evidence("coverage")
    if kept is None:
        return _not_yet()
    rows = [
        [reason, f"{line['constructs']:,}", "proved" if line["proved"] else "argued"]
        for reason, line in sorted(kept["reasons"].items(), key=lambda item: -item[1]["constructs"])
    ]
    return markdown(["never reached, because", "constructs", ""], rows)


@table
def points() -> str:
    """Functional points, group by group."""
    kept = evidence("coverage")
    if kept is None:
        return _not_yet()
    rows = [[group, f"{line['reached']:,} of {line['points']:,}"] for group, line in kept["points"].items()]
    return markdown(["points of", "reached"], rows)


@table
def load() -> str:
    """Four arbiters under the same loads."""
    kept = read("benchmarks/results/load.json")
    rows = []
    for line in kept["results"]:
        name = f"{line['load']}, {line['asked']:.0%}" if line["arbiter"].endswith("(ours)") else ""
        numbers = [f"{line['throughput']:.3f}", f"{line['mean_wait']:.1f}", f"{line['wait_99']:.0f}"]
        numbers += [f"{line['worst_wait']:,}", f"{line['jain']:.3f}"]
        rows.append([name, line["arbiter"], *numbers, "{:,.1f} to {:,.1f}".format(*line["by_address"])])
    head = ["load", "arbiter", "events per clock", "mean wait", "99 %", "worst", "Jain", "mean wait by address"]
    said = f"`{kept['command']}`, {kept['commit']}, {kept['date']}.\n"
    return f"{markdown(head, rows)}\n{said}"


@table
def replay() -> str:
    """What was driven through the RTL from end to end, by encoder."""
    rows = []
    for run in read("docs/data/verification/replay.json")["runs"]:
        config = run["configuration"]
        name = ENCODERS[config["encoding"]]
        numbers = [f"{run[key]:,}" for key in ("images", "clocks", "events", "mismatches")]
        rows.append([name, *numbers, run["commit"], run["date"]])
    return markdown(["encoder", "scans", "clocks", "events", "mismatches", "commit", "date"], rows)
