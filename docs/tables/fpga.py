"""What designs take of an FPGA."""

from __future__ import annotations

from typing import Any

from docs.tables.written import ROOT, markdown, read, table

HEAD = ["design", "command", "clock", "LUT4", "flops", "block RAMs", "commit", "date"]


def routed() -> dict[str, dict[str, Any]]:
    """Return the reports of ``make fpga`` that are kept, by name."""
    paths = sorted((ROOT / "docs/data/fpga").glob("*.json"))
    return {path.stem: read(f"docs/data/fpga/{path.name}") for path in paths}


def _row(name: str, report: dict[str, Any]) -> list[str]:
    return [
        name,
        f"`{report['command']}`",
        f"{report['clock_hz'] / 1e6:.1f} MHz",
        f"{report['luts']:,}",
        f"{report['used']['TRELLIS_FF']:,}",
        f"{report['block_rams']} ({report['memory_bytes'] / 1024:g} kB)",
        report["commit"],
        report["date"],
    ]


@table
def fpga_boards() -> str:
    """Designs for a board."""
    return markdown(HEAD, [_row(name, one) for name, one in routed().items() if one["design"] != "classifier"])


@table
def fpga_classifier() -> str:
    """The classifier alone, beside what was aimed at."""
    rows = []
    for name, report in routed().items():
        if report["design"] == "classifier":
            rows.append([*_row(name, report), "; ".join(_aim(aim) for aim in report["aims"])])
    return markdown([*HEAD, "aims"], rows)


def _aim(aim: dict[str, Any]) -> str:
    return f"{aim['what']} {aim['wanted']:g}: {'met' if aim['met'] else '**missed**'}"
