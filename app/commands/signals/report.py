"""The command report (docs/guide/report.md)."""

from pathlib import Path

from eskin.app.cli import echo
from eskin.app.commands import common
from eskin.app.options import opt, out_file
from eskin.base.errors import InputError


def _is_page(path: Path) -> bool:
    return path.suffix.lower() in (".html", ".htm")


def report(
    out: Path = out_file(
        Path("out/report.html"),
        "FILE",
        "page to write, .html, or the folder of runs and page",
        when=lambda given: given["out"].is_dir() and not _is_page(given["out"]),
    ),
    sim: Path | None = opt(None, "DIR", "runs of make sim: event files of RTL and model [out/sim]"),
    replay: Path | None = opt(None, "DIR", "results of make replay [out/replay]"),
    benchmarks: Path | None = opt(None, "DIR", "benchmark results [benchmarks/results]"),
    accuracy: Path | None = opt(None, "FILE", "accuracy and data rates of Fig. 9 [app/report/fig9.json]"),
    synthesis: common.Synthesis = None,
) -> None:
    """Write all figures of the project into one self-contained HTML file."""
    from eskin.app.report.data import report_data
    from eskin.app.report.page import ACCURACY, BENCHMARKS, REPLAY, SIM, page, runs_in
    from eskin.base.files import atomic_write

    if out.is_dir() and not _is_page(out):
        found = runs_in(out)
        sim, replay, out = sim or found[0], replay or found[1], out / "report.html"
    if not _is_page(out):
        raise InputError(f"the report is an HTML page and ends in .html, but {out.name} does not; rename the output")
    for folder in (sim, replay, benchmarks):
        if folder is not None and not folder.is_dir():
            raise InputError(f"{folder} is not a folder; give a folder, or leave the option out")
    if accuracy is not None and not accuracy.is_file():
        raise InputError(f"cannot read the accuracy results {accuracy}: there is no such file")
    data, runs = report_data(
        sim or SIM, replay or REPLAY, benchmarks or BENCHMARKS, accuracy or ACCURACY, list(synthesis or [])
    )
    text = page(data, runs).encode()
    with atomic_write(out) as file:
        file.write(text)
    echo(f"wrote {out} ({len(text) / 1e6:.1f} MB); open it in a browser")
    for sentences in data["missing"].values():
        for sentence in sentences:
            print(f"note: {sentence}")
