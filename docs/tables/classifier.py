"""The classifier in hardware."""

from __future__ import annotations

from docs.tables.written import markdown, percent, read, table


@table
def touch() -> str:
    """What each step from touch to class takes, over a whole dataset in the RTL."""
    kept = read("docs/data/touch.json")
    chip = kept["chip"]
    seconds = kept["clocks"] / (chip["sample_rate_hz"] * chip["clocks_per_sample"])
    taxels, labelled = chip["rows"] * chip["columns"], kept["labelled"]
    samples = taxels * chip["sample_rate_hz"] * chip["sample_bits"] / 1e6
    rate, bits = kept["events"] / seconds, (taxels - 1).bit_length() + 1
    late_us = 1e6 * kept["latency_clocks"] * seconds / kept["clocks"]
    rows = [
        [
            "samples",
            f"{taxels} x {chip['sample_bits']} b at {chip['sample_rate_hz'] / 1e3:g} kHz",
            f"{samples:.1f} Mb/s",
        ],
        ["address events", f"{rate:,.0f} a second of {bits} b", f"{rate * bits / 1e3:.0f} kb/s"],
        [
            "network",
            f"{chip['classifier_hidden']} neurons, weights of {chip['classifier_rec_bits']} b",
            f"{kept['additions'] / seconds / 1e6:.1f} M additions/s",
        ],
        ["class", f"every {1e3 * chip['classifier_bin_s']:g} ms", f"{late_us:.0f} us after it at the latest"],
        ["right", f"{kept['right']} of {labelled} in the RTL", f"{kept['right_float']} of {labelled} before rounding"],
    ]
    sums = f"{kept['images']} images, {kept['clocks']:,} clocks, {kept['events']:,} events"
    said = f"`{kept['command']}`, commit {kept['commit']}, {kept['date']}: {sums}, {kept['mismatches']} mismatches."
    return markdown(["from touch to class", "", ""], rows) + f"\n{said}\n"


@table
def precision() -> str:
    """Accuracy of networks in whole numbers by bits of their weights."""
    kept = read("docs/data/classifier/precision.json")
    points = {(point["network"], point["variant"]): point for point in kept["points"]}
    variants = [v for v in dict.fromkeys(point["variant"] for point in kept["points"]) if v == "float" or v.isdigit()]
    rows = []
    for network in dict.fromkeys(name for name, _ in points):
        own = [points[network, variant] for variant in variants]
        memory = {point["variant"]: point["memory_bits"] / 8000 for point in own if "memory_bits" in point}
        cells = [f"{100 * point['accuracy']:.1f}" for point in own]
        sizes = f"{memory['8']:.0f}, {memory['4']:.0f}" if {"8", "4"} <= set(memory) else ""
        rows.append([network, str(own[0]["seeds"]), percent(own[0]).replace(" %", ""), *cells[1:], sizes])
    head = ["network", "seeds", "float", *(f"{variant} b" for variant in variants[1:]), "kB at 8, 4 b"]
    return markdown(head, rows) + f"\n`{kept['command']}`\n"
