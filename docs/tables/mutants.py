"""Mutants: how many were killed, by block and file, and what is left."""

from __future__ import annotations

from typing import Any

from docs.tables.verification import evidence
from docs.tables.written import markdown, table

NOT_YET = "Not run yet.\n"
COUNTS = ("total", "equivalent", "argued", "killed", "alive")


def _share(part: int, counts: dict[str, int]) -> str:
    rest = counts["total"] - counts.get("equivalent", 0) - counts["argued"]
    return f"{part / rest:.1%}" if rest else ""


@table
def mutants() -> str:
    """What became of the mutants of the RTL, block by block."""
    kept = evidence("mutants")
    if kept is None:
        return NOT_YET
    rows = []
    for block, counts in [*kept["per_block"].items(), ("all", kept)]:
        shares = [_share(counts["killed"], counts), _share(counts["killed_quick"], counts)]
        rows.append([block, *(f"{counts[name]:,}" for name in COUNTS[:3]), *shares, str(counts["alive"])])
    head = ["block", "mutants", "proved equivalent", "argued", "killed of the rest", "by the quick check", "alive"]
    said = f"`{kept['command']}`, {kept['commit']}, {kept['date']}: {kept['result']}.\n"
    more = f"{kept['by_a_property_alone']} of the killed fall to a property of `make formal` alone.\n"
    return f"{markdown(head, rows)}\n{said}{more}{_open(kept)}"


def _open(kept: dict[str, Any]) -> str:
    """Return what the shares would be if all that are not yet judged lived."""
    left = kept["planned"] - kept["total"] - kept["stillborn"]
    rest = kept["planned"] - kept["stillborn"] - kept["equivalent"] - kept["argued"]
    if not left:
        return ""
    whole, quick = (f"{kept[name] / rest:.0%}" for name in ("killed", "killed_quick"))
    return (
        f"The {left} not yet judged are no fair part: what block tests left, equivalent ones among them, and what no "
        f"test was asked about yet. If all of them lived, {whole} would be killed, {quick} by the quick check.\n"
    )


@table
def survivors() -> str:
    """Every mutant that nothing kills, and those that an argument takes out of the count."""
    kept = evidence("mutants")
    if kept is None:
        return NOT_YET
    parts = [kept, kept.get("model_and_snn", {"survivors": [], "argued_one_by_one": []})]
    alive = [[f"`{one['name']}`", "alive"] for part in parts for one in part["survivors"]]
    argued = [[f"`{one['name']}`", one["why"]] for part in parts for one in part["argued_one_by_one"]]
    rows = [[cell.replace("|", "\\|") for cell in row] for row in [*alive, *argued]]
    return markdown(["mutant", "what is known of it"], rows)


@table
def model_mutants() -> str:
    """What became of the sampled mutants of model/ and snn/, file by file."""
    kept: dict[str, Any] | None = (evidence("mutants") or {}).get("model_and_snn")
    if kept is None:
        return NOT_YET
    rows = [
        [f"`{file}`", *(str(counts[name]) for name in ("places", "total", "argued", "killed", "alive"))]
        for file, counts in kept["per_file"].items()
    ]
    rows.append(["all", f"{kept['places']:,}", *(str(kept[name]) for name in ("total", "argued", "killed", "alive"))])
    head = ["file", "places", "mutants", "argued", "killed", "alive"]
    return f"{markdown(head, rows)}\n`{kept['command']}`, {kept['commit']}, {kept['date']}: {kept['result']}.\n"
