"""What the page of the power model claims: the outcome, and the corrections."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any

from scipy import constants

from docs.tables.claims import claim
from docs.tables.netlists import by_frames
from docs.tables.written import read
from model.power.build import build_model
from model.power.equations import CORRECTIONS, PowerModel
from model.power.rates import stored_table
from model.power.study import FIG6_NOISE_V, FIG7_NOISE_V, RESOLUTIONS, settling_bandwidth

PAGE = "docs/results/power.md"


@cache
def consistent(preset: str = "paper", without: str = "", setting: str = "") -> PowerModel:
    """Return the model with all corrections but one, from the stored event rates."""
    corrections = frozenset(CORRECTIONS) - {without}
    return build_model(corrections, [setting] if setting else None, None, lambda: stored_table(preset))


def ratio(model: PowerModel, readout: Any, bits: int = 6, noise: float = FIG7_NOISE_V, tau_s: float = 0.2) -> float:
    """Return spiking over frame power."""
    return float(model.breakdown(readout, bits, noise, tau_s).total / model.breakdown("frame", bits, noise).total)


def parts(path: str = "docs/data/fig6.json") -> dict[str, Any]:
    """Return what the readouts draw at the middle noise of Fig. 6, with all corrections."""
    return dict(read(path)["modes"]["consistent"][1])


def case(name: str) -> dict[str, Any]:
    """Return a row of the sensitivity study."""
    (row,) = (row for row in read("docs/data/sensitivity.json")["rows"] if row["case"] == name)
    return dict(row)


def cheaper_up_to(readout: Any, preset: str, tau_s: float) -> int:
    """Return the finest resolution at which spikes cost less, with all corrections."""
    wins = [bits for bits in RESOLUTIONS if ratio(consistent(preset), readout, bits, tau_s=tau_s) < 1]
    assert wins == list(range(1, len(wins) + 1))
    return len(wins)


def needed_khz(preset: str, readout: Any) -> float:
    """Return the bandwidth above which spikes cost less than frames, with all else corrected."""
    low, high = 1.0, 1e5
    while high / low > 1.0001:
        middle = (low * high) ** 0.5
        model = consistent(preset, setting=f"signal_bandwidth_hz={middle}")
        low, high = (middle, high) if ratio(model, readout) > 1 else (low, middle)
    return high / 1e3


@claim(PAGE)
def outcome() -> Iterator[str]:
    """The outcome in words."""
    crossing = read("docs/data/fig7.json")["modes"]["paper"]["crossover"]
    yield f"frames above about {1e3 * crossing['lcs'][5]:.2f} mV of AFE noise at 6 bit"
    published = parts()
    yield (
        f"6-bit LCS costs {float(by_frames(published, 'lcs')):.0f} times and "
        f"6-bit N-LCS (200 ms) {float(by_frames(published, 'nlcs')):.1f} times what frames cost"
    )
    ihp, osu = (parts(f"docs/data/asic/{library}/fig6.json") for library in ("ihp", "osu"))
    lcs, nlcs = ([float(by_frames(one, readout)) for one in (ihp, osu)] for readout in ("lcs", "nlcs"))
    yield (
        f"measured on netlists, {lcs[0]:.0f} and {nlcs[0]:.1f} times in 130 nm, "
        f"{lcs[1]:.0f} and {nlcs[1]:.1f} times in 180 nm"
    )
    settles = case("all, shared AFE settles")["crossover"]["nlcs"]
    assert settles["spikes_win"] == "below"
    yield f"comes back for N-LCS at low noise, below {1e3 * settles['noise_v_rms']:.2f} mV"
    yield f"N-LCS then wins where the AFE dominates, below {1e3 * settles['noise_v_rms']:.2f} mV"
    unlimited = case("all but bandwidth")
    assert unlimited["crossover"]["lcs"]["spikes_win"] == unlimited["crossover"]["nlcs"]["spikes_win"] == "always"
    times = [1 / unlimited["ratio"][readout][1] for readout in ("nlcs", "lcs")]
    middle_mv = 1e3 * read("docs/data/sensitivity.json")["noise_v_rms"][1]
    yield f"by {times[0]:.0f} times (N-LCS) and {times[1]:.1f} times (LCS) at {middle_mv:.3f} mV"


@claim(PAGE)
def spikes_cost_less() -> Iterator[str]:
    """Where spikes cost less than frames with all corrections."""
    short, long = ([cheaper_up_to("nlcs", preset, tau) for preset in ("paper", "physical")] for tau in (0.2, 2.0))
    assert short[0] == short[1]
    yield (
        f"200 ms up to {short[0]} bit in both scans, 2 s up to {long[0]} bit (`paper` scan) or {long[1]} bit "
        "(`physical` scan)"
    )
    assert cheaper_up_to("lcs", "physical", 0.2) == 0
    yield f"LCS does so only at {cheaper_up_to('lcs', 'paper', 0.2)} bit, and only in the `paper` scan"
    paper, physical = (
        [f"{needed_khz(preset, readout):.2g}" for readout in ("nlcs", "lcs")] for preset in ("paper", "physical")
    )
    yield f"must follow more than {paper[0]} kHz (N-LCS) or {paper[1]} kHz (LCS)"
    yield f"in the `physical` scan {physical[0]} and {physical[1]} kHz"


@claim(PAGE)
def corrections() -> Iterator[str]:
    """What single corrections are worth."""
    rates, fit = stored_table(), 2429 * 2.0**4
    yield (
        f"LCS at 6 b makes {rates.population_hz('lcs', 6):,.0f} events/s, "
        f"{rates.population_hz('lcs', 6) / fit:.2f} times the fit"
    )
    apart = {n: rates.population_hz("nlcs", n) / (3009.6 * 2.0 ** (n - 4)) - 1 for n in RESOLUTIONS}
    largest = max(abs(apart[n]) for n in RESOLUTIONS if n >= 4)
    yield f"200 ms is within {100 * largest:.0f} % of its fit from 4 b on, {-100 * apart[2]:.0f} % below it at 2 b"
    bandwidths = [stored_table(preset, data).bandwidth_hz for data in DATA for preset in ("paper", "physical")]
    yield f"{bandwidths[0]:g} Hz in the `paper` scan, close to the 97 Hz, and {bandwidths[1]:g} Hz in"
    yield f"embedded textures {bandwidths[2]:g} and {bandwidths[3]:g} Hz"
    uneven = []
    for preset in ("paper", "physical"):
        table = stored_table(preset)
        of_taxels = table.lcs_hz[table.resolutions.index(6)]
        uneven.append(100 * (max(of_taxels) / min(of_taxels) - 1))
    yield f"the busiest makes {uneven[0]:.0f} % more events than the calmest in the `paper` scan, {uneven[1]:.0f} %"
    yield f"costs frames {consistent().parameters.taxels} times more AFE"
    io = read("docs/data/fig6.json")["modes"]["paper"][1]["frame"]["io"]
    yield f"which is little beside {1e6 * io:.0f} uW of pads"


DATA = ("kylberg", "embedded")


@claim(PAGE)
def at_a_millivolt() -> Iterator[str]:
    """What the readouts draw with all corrections, by part, and an amplifier that settles."""
    nlcs, lcs, frame = (consistent().breakdown(name, 6, FIG7_NOISE_V).to_dict() for name in ("nlcs", "lcs", "frame"))

    def micro(found: dict[str, Any], part: str) -> float:
        return 1e6 * float(found[part] if part in found else found["converter_parts"][part])

    yield (
        f"N-LCS draws {micro(nlcs, 'total'):.2f} uW ({micro(nlcs, 'decay_filter'):.2f} decay filter, "
        f"{micro(nlcs, 'v_to_i'):.2f} V-to-I, {micro(nlcs, 'line_bias'):.2f} lines, {micro(nlcs, 'io'):.1f} pads)"
    )
    yield (
        f"LCS {micro(lcs, 'total'):.1f} uW ({micro(lcs, 'comparator_static'):.1f} comparators, "
        f"{micro(lcs, 'line_bias'):.1f} lines, {micro(lcs, 'io'):.1f} pads), "
        f"frames {micro(frame, 'total'):.2f} uW ({micro(frame, 'io'):.2f} pads)"
    )
    bandwidth = f"{settling_bandwidth(consistent()):.1f}"
    yield f"= {bandwidth} times that at 6 b"
    both = [ratio(consistent(preset), "nlcs", tau_s=2.0) for preset in ("physical", "paper")]
    rates = [stored_table(preset).population_hz("nlcs", 6, 2.0) for preset in ("physical", "paper")]
    yield (
        f"2 s makes {rates[0]:,.0f} events/s at 6 b instead of {rates[1]:,.0f} and costs {both[0]:.1f} times the "
        f"frames instead of {both[1]:.2f}"
    )
    apart = abs(_counted("cw-lcs") / _counted("lcs") - 1)
    yield f"its events on textures differ from those of LCS by {100 * apart:.2f} %"
    plain = build_model(frozenset(), None, None, stored_table)
    corrected = build_model(frozenset({"afe_nef"}), None, None, stored_table)
    afe = [float(model.breakdown("lcs", 6, FIG7_NOISE_V).to_dict()["afe"]) for model in (plain, corrected)]
    worth = corrected.parameters.noise_efficiency * (afe[0] / afe[1]) ** 0.5
    yield f"The original's AFE is worth NEF {worth:.0f} a taxel"
    higher = (constants.k / 1.38e-23) ** 2 / (constants.e / 1.602e-19) - 1
    yield f"(CODATA's give an AFE {100 * higher:.2f} % higher)"
    middle = FIG6_NOISE_V[1]
    yield f"V = {1e3 * middle:.3f} mV, the 15th"


def _counted(encoding: str) -> int:
    runs = read("docs/data/verification/replay.json")["runs"]
    (run,) = (run for run in runs if run["configuration"]["encoding"] == encoding)
    return int(run["events"])
