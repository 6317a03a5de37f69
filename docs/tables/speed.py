"""Speed and scale."""

from __future__ import annotations

from typing import Any

from docs.tables.written import digits, markdown, read, table


@table
def speed_encoders() -> str:
    """Encoders against a plain copy, for many signals and for one array."""
    names = {
        "copy": "copy",
        "lcs": "LCS",
        "lcs, counts per taxel only": "LCS, events per taxel only",
        "cw-lcs": "CW-LCS",
        "nlcs": "N-LCS (4,096 signals)",
        "lcs, numpy over time": "LCS, NumPy over the taxels, Python over time",
        "snntorch delta": "snnTorch `spikegen.delta` (1,024 signals)",
    }
    many, one = (
        {r["name"]: r for r in read(f"benchmarks/results/{name}.json")["results"]} for name in ("encoder", "encoder_64")
    )
    rows = []
    for name, text in names.items():
        times = many[name]["times_the_copy"]
        rows.append(
            [
                text,
                f"{many[name]['taxel_samples_per_second'] / 1e6:,.0f}",
                f"{digits(times['median'], 3)} ({digits(times['least'], 3)} to {digits(times['most'], 3)})",
                digits(one[name]["times_the_copy"]["median"], 3),
            ]
        )
    return markdown(["", "million taxel-samples/s", "times the copy", "64 taxels"], rows)


@table
def scale_arrays() -> str:
    """Generation, lint and simulation of square arrays."""
    rows = []
    made = {array["taxels"]: array["synthesis_s"] for array in read(SCALE)["results"]}
    for array in read("benchmarks/results/scale_arrays.json")["results"]:
        taxels = array["taxels"]
        runs = {(r["simulator"], r["row_by_row"]): r for r in array["simulations"]}
        whole, slow = runs["verilator", True], runs.get(("icarus", False))
        flat = runs.get(("verilator", False))
        rows.append(
            [
                f"{array['side']} x {array['side']}",
                f"{array['generate_s']:.1f} ({digits(1000 * array['generate_s'] / taxels, 2)})",
                f"{made[taxels]:.1f} ({digits(1000 * made[taxels] / taxels, 2)})" if taxels in made else "",
                f"{array['verilog_bytes'] / 1000:,.0f}",
                f"{array['lint_s']:.1f}",
                f"{whole['build_s']:.0f}",
                f"{whole['clocks_per_second']:,.0f} ({digits(whole['clocks_per_second'] * taxels / 1e6, 2)})",
                f"{flat['build_s']:.0f}; {flat['clocks_per_second']:,.0f}" if flat else "",
                f"{slow['clocks_per_second']:,.0f}" if slow else "",
            ]
        )
    head = [
        "taxels",
        "generation, s (ms a taxel)",
        "synthesis, s (ms a taxel)",
        "Verilog, kB",
        "lint, s",
        "build row by row, s",
    ]
    head += ["clocks/s (million taxel-clocks/s)", "flat: build, s; clocks/s", "Icarus, clocks/s"]
    return markdown(head, rows)


SCALE = "docs/data/asic/scale-lcs-digital-ihp.json"


@table
def scale_wires() -> str:
    """Area and highest clock of arrays, without wires and with them."""
    rows = []
    for array in read(SCALE)["results"]:
        without, wired = array["without_wires"], array["with_wires"]
        lines = wired["path_in_repeaters_s"] + wired["path_in_wires_s"]
        rows.append(
            [
                f"{array['rows']} x {array['columns']}",
                f"{array['cells_um2_per_taxel']:,.0f}",
                f"{wired['area_um2_per_taxel']:,.0f} ({digits(wired['repeaters'] / array['taxels'], 2)})",
                f"{digits(1000 * wired['lines_m'] / array['taxels'], 2)}",
                f"{without['fmax_hz'] / 1e6:.0f} ({without['logic_depth']})",
                f"{wired['fmax_hz'] / 1e6:.0f} ({wired['logic_depth']})",
                f"{100 * lines / wired['path_s']:.0f} %",
                f"{_block(wired['path'][0])} to {_block(wired['path'][-1])}",
            ]
        )
    head = ["taxels", "um2 a taxel, cells", "with repeaters (repeaters a taxel)", "lines, mm a taxel"]
    head += ["MHz without wires (cells in the path)", "MHz with wires", "of the path in lines and repeaters", "path"]
    return markdown(head, rows)


TILES = "docs/data/asic/scale-tiles-lcs-digital-ihp.json"


@table
def scale_tiles() -> str:
    """Area and highest clock of 4,096 taxels as one array and as tiles with relay stations, beside those of 64."""
    arrays = {(array["rows"], array["columns"]): array for array in read(SCALE)["results"]}
    small, large = arrays[8, 8], arrays[64, 64]
    rows = []
    for array in [small, large, *read(TILES)["results"]]:
        wired = array["with_wires"]
        cut = "one array"
        if "relays" in array:
            down, across = array["rows"] // array["tile_rows"], array["columns"] // array["tile_columns"]
            cut = f"{array['tile_rows'] * array['tile_columns']} tiles of {down} x {across}"
        clocks, areas = ([a["with_wires"][name] for a in (array, small)] for name in ("fmax_hz", "area_um2_per_taxel"))
        rows.append(
            [
                f"{array['rows']} x {array['columns']}",
                cut,
                f"{array.get('relays', '')}",
                f"{array['cells_um2_per_taxel']:,.0f}",
                f"{areas[0]:,.0f} ({100 * (areas[0] / areas[1] - 1):+.1f} %)",
                f"{array['without_wires']['fmax_hz'] / 1e6:.0f}",
                f"{clocks[0] / 1e6:.0f} ({100 * clocks[0] / clocks[1]:.0f} %)",
                f"{_block(wired['path'][0])} to {_block(wired['path'][-1])}",
                f"{wired['between_flops_hz'] / 1e6:.0f}",
            ]
        )
    head = ["taxels", "as", "relay stations a line", "um2 a taxel, cells", "with repeaters (beside 8 x 8)"]
    head += ["MHz without wires", "MHz with wires (of 8 x 8)", "path", "MHz with wires, between flops alone"]
    return markdown(head, rows)


def _block(name: str) -> str:
    """Return what a path begins or ends at, in a word: the block of a flop, else the port."""
    return (
        name.split(".")[0].split("_")[0] if "." in name and "taxel" not in name else name.split("[")[0].split(".")[-1]
    )


@table
def scale_skins() -> str:
    """A skin of 65,536 taxels on one output."""
    rows = [
        [
            f"{skin['resolution']} b",
            f"{skin['clock_hz'] / 1e6:,.4g} MHz",
            f"{skin['clocks']:,}",
            f"{skin['events_of_tiles_alone']:,} ({skin['offered_per_clock']:.2f})",
            f"{skin['events']:,} ({skin['events_per_clock']:.2f})",
            f"{skin['fewest_of_a_tile']:,} to {skin['most_of_a_tile']:,}",
            f"{skin['model_s']:.1f}",
        ]
        for skin in read("benchmarks/results/scale_skins.json")["results"]
    ]
    head = [
        "LCS",
        "clock",
        "clocks",
        "tiles alone: events (a clock)",
        "merged: events (a clock)",
        "of a tile",
        "model, s",
    ]
    return markdown(head, rows)


@table
def speed_cosim() -> str:
    """Co-simulation and model against a bare Verilator loop."""
    rows = []
    for r in read("benchmarks/results/cosim.json")["results"]:
        median, least, most = (digits(r["of_bare_loop"][name], 3) for name in ("median", "least", "most"))
        rows.append([r["name"], f"{r['clocks_per_second']:,.0f}", f"{median} ({least} to {most})"])
    return markdown(["", "clocks/s", "of the bare loop"], rows)


@table
def speed_layer() -> str:
    """One training step of the recurrent layer: CPU time and memory of every candidate."""
    results = read("benchmarks/results/network.json")["results"]
    results.sort(key=lambda r: (r["rate"], r["steps"]))
    rows = []
    for name in results[0]["candidates"]:
        of_cases = [r["candidates"][name] for r in results]
        rows.append([name, *(_time_and_memory(case) for case in of_cases)])
    rows.append(["matrix products alone (torch)", *(f"{1e3 * r['limit_cpu_s']['median']:.1f}" for r in results)])
    kernel = [r["candidates"]["this project, kernel"]["cpu_s"]["median"] for r in results]
    fastest = [min(c["cpu_s"]["median"] for c in r["candidates"].values() if c["library"]) for r in results]
    rows.append(["fastest library or loop / kernel", *(f"{f / k:.1f}" for f, k in zip(fastest, kernel, strict=True))])
    limits = [r["limit_cpu_s"]["median"] for r in results]
    rows.append(["kernel / matrix products", *(f"{k / limit:.2f}" for k, limit in zip(kernel, limits, strict=True))])
    head = ["", *(f"{r['steps']} steps, {100 * r['input_density']:.0f} % of the inputs" for r in results)]
    return markdown(head, rows)


def _time_and_memory(candidate: dict[str, Any]) -> str:
    """Return ms, and MiB where they were measured."""
    milliseconds, memory = 1e3 * candidate["cpu_s"]["median"], candidate["peak_mib"]
    return f"{milliseconds:.1f}" if memory is None else f"{milliseconds:.1f}, {memory:.0f}"


@table
def leak() -> str:
    """The leak of N-LCS in integers against floating point, per cent of the event rate."""
    rows = []
    for r in read("benchmarks/results/leak.json")["results"]:
        low, high = r["exponential"]
        numbers = [f"{r['fractions'][fraction]:.2f}" for fraction in ("4", "6", "8", "10", "12")]
        limits = [f"{low:+.2f} to {high:+.2f}", f"{r['moving']:+.2f}"]
        rows.append([str(r["resolution"]), str(r["leak_shift"]), *numbers, *limits])
    return markdown(["N", "k", *(f"F = {f}" for f in (4, 6, 8, 10, 12)), "exponential", "moving"], rows)
