"""Tables of the power model and its event rates."""

from typing import Any

from docs.tables.netlists import netlists
from docs.tables.write import ROOT, Rows, digits, filled, only, read
from eskin.power.readouts import READOUT_NAMES, SPIKING, published
from eskin.skin.figures.readouts import FRAME, look


def event_rates() -> Rows:
    """Return event rates: published, from float samples, and ours."""
    points = read("docs/data/event_rates.json")["points"]
    return [point | {"more": point["here_hz"] / point["published_hz"] - 1} for point in points]


def array_hz(dataset: str, preset: str, encoding: str, resolution: int) -> float:
    """Return the event rate that the power model uses for the array; tau of N-LCS is 200 ms."""
    rates = only(read("power/event_rates.json")["tables"], dataset=dataset, preset=preset)
    of_encoding = published(encoding, lcs=rates["lcs_hz"], nlcs=rates["nlcs_hz"][rates["taus_s"].index(0.2)])
    return float(sum(of_encoding[rates["resolutions"].index(resolution)]))


def other_rates() -> Rows:
    """Yield the event rates of the other presets and textures."""
    for encoding, bits in (("lcs", 2), ("lcs", 4), ("lcs", 6), ("nlcs", 4), ("nlcs", 8)):
        scans = [("kylberg", "physical"), ("embedded", "paper"), ("embedded", "physical")]
        cells = (f"{array_hz(*scan, encoding, bits):,.0f}" for scan in scans)
        yield [filled("{e:E} {bits} b", {"e": encoding, "bits": bits}), *cells]


def by_resolution(mode: str, value: str, cell: str) -> Rows:
    """Yield a value of Fig. 7 at each resolution: of LCS, and of N-LCS for each time constant."""
    values = read("docs/data/fig7.json")["modes"][mode][value]
    by_name = {"LCS": values["lcs"]} | {f"N-LCS {1e3 * float(tau):.0f} ms": row for tau, row in values["nlcs"].items()}
    for name, row in by_name.items():
        yield [name, *(filled(cell, {"v": one}) for one in row)]


def sensitivity(case: str) -> dict[str, Any]:
    """Return a row of the sensitivity study."""
    return only(read("docs/data/sensitivity.json")["rows"], case=case)


def measured_libraries() -> dict[str, str]:
    """Return the libraries with measured logic of all three readouts, and their gate lengths."""
    both = {"ihp": "130 nm", "osu": "180 nm"}
    return {name: cells for name, cells in both.items() if (ROOT / "docs/data/asic" / name / "fig6.json").exists()}


def breakdown(library: str = "") -> dict[str, Any]:
    """Return the power at 0.92 mV and 6 b with all corrections, and a library's measured logic if given."""
    path = f"docs/data/asic/{library}/fig6.json" if library else "docs/data/fig6.json"
    return dict(read(path)["modes"]["consistent"][1])


def by_frames(readout: str, library: str = "") -> str:
    """Return the power of a readout divided by that of frames."""
    parts = breakdown(library)
    return digits(parts[readout]["total"] / parts["frame"]["total"], 3)


def power_measured() -> Rows:
    """Yield the power comparison with measured logic."""
    before = breakdown()
    for library, cells in measured_libraries().items():
        for readout in (*sorted(SPIKING), FRAME):
            old, new = before[readout], breakdown(library)[readout]
            frames = readout == FRAME
            leakage = 64 * netlists()[f"{readout}{'' if frames else '-analog'}-8x8-{library}"]["leakage_w_per_taxel"]
            parts = [new["converter_parts"]["logic"], leakage, old["total"], new["total"]]
            before_w = "none" if frames else digits(1e6 * old["converter_parts"]["logic"], 3)
            ratios = ["", ""] if frames else [by_frames(readout), by_frames(readout, library)]
            after = [digits(1e6 * watts, 3) for watts in parts]
            yield [f"{look(readout).title}, {cells}", before_w, *after, *ratios]


def power_rows() -> list[list[str]]:
    """Return the power ratio to frames, and the noise at which spikes need less power."""
    ratios = {}
    for mode, text in (("paper", "the paper's model"), ("consistent", "seven corrections")):
        ratio = read("docs/data/fig7.json")["modes"][mode]["ratio"]
        ratios[text] = digits(ratio["lcs"][5], 3), digits(ratio["nlcs"]["0.2"][5], 3)
    for library, cells in measured_libraries().items():
        text = f"seven corrections, measured logic of netlists in {cells} cells"
        ratios[text] = by_frames("lcs", library), by_frames("nlcs", library)
    head = "power of spikes / power of frames (6 b, 1 mV of noise)"
    rows = [[f"{head}: {text}", "", f"{lcs} (LCS), {nlcs} (N-LCS)"] for text, (lcs, nlcs) in ratios.items()]
    for case, text in (("none (paper)", "the paper's model"), ("all (consistent)", "seven corrections")):
        ends = []
        for readout in sorted(SPIKING):
            wins = sensitivity(case)["crossover"][readout]
            noise = "" if wins["noise_v_rms"] is None else f" {1e3 * wins['noise_v_rms']:.2f} mV"
            ends.append(f"{wins['spikes_win']}{noise} ({READOUT_NAMES[readout]})")
        rows.append([f"range of noise in which spikes take less power than frames (6 b): {text}", "", ", ".join(ends)])
    return rows
