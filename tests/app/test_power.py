"""Test the commands power and explore, and their files."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig
from eskin.power.equations import CORRECTIONS, PowerModel
from eskin.power.explore import GivenRates
from eskin.power.parameters import PowerParameters
from eskin.power.rates import RESOLUTIONS, TAUS_S, RateTable, load_tables, measure_table, stored_table
from eskin.power.readouts import READOUTS
from eskin.skin.textures.dataset import open_dataset
from eskin.skin.textures.presets import preset
from eskin.skin.textures.rates import measure_rates

DOCS = Path(__file__).resolve().parents[2] / "docs"
RATES = stored_table("paper")
MODELS = {"paper": PowerModel(), "consistent": PowerModel(corrections=frozenset(CORRECTIONS), measured=RATES)}
REPORT = {
    "readout": "lcs",
    "rows": 8,
    "columns": 8,
    "clock_hz": 1e6,
    "area_um2": 1e5,
    "leakage_w": 1e-7,
    "clock_power_w_per_hz": 1e-12,
    "energy_per_event_j": 1e-13,
}


# -- power -------------------------------------------------------------------------------------------


@pytest.mark.command("power")
def test_power_prints_the_breakdown_as_json(call):
    code, out, _ = call("power --mode paper --resolution 6 --noise 1e-4 --tau 0.2 --json")
    data = json.loads(out)
    assert (code, list(data)) == (0, ["nlcs", "lcs", "frame"])
    for readout, entry in data.items():
        assert entry == MODELS["paper"].breakdown(readout, 6, 1e-4, 0.2).to_dict()
    code, out, _ = call("power")
    assert code == 0
    assert all(text in out for text in ("N-LCS", "LCS", "frame", "decay filter", "total", "345 uW", "961 uW"))


def test_power_prints_crossovers_as_json(call):
    code, out, _ = call("power --mode paper --crossover --json")
    data = json.loads(out)
    assert (code, list(data), sorted(data["nlcs"])) == (0, ["lcs", "nlcs"], ["0.02", "0.2", "2.0"])
    assert [len(line) for line in (data["lcs"], *data["nlcs"].values())] == [10] * 4
    assert data["lcs"][5] == MODELS["paper"].crossover("lcs", 6).noise_v_rms
    assert data["nlcs"]["0.2"][8:] == [None, None]
    code, out, _ = call("power --crossover")
    assert (code, "> 0.5418" in out) == (0, True)


def test_power_takes_single_corrections(call):
    def io(options: str) -> float:
        return json.loads(call(f"power --json {options}")[1])["lcs"]["io"]

    assert io("--correct pads") == pytest.approx(io("") * (1.8 / 5) ** 2 * 5.5 / 9)
    assert io("--correct event_rates") == pytest.approx(io("--without pads"), rel=1e-9)
    assert io("--mode consistent") == pytest.approx(io("--correct event_rates,pads"), rel=1e-9)
    assert io("--set io_voltage_v=3.3") == pytest.approx(io("") * (3.3 / 5) ** 2)


def test_power_takes_a_synthesis_report_and_lists_parameters(call, folder):
    (folder / "gates.json").write_text(json.dumps(REPORT | {"cells": 1234}))
    data = json.loads(call("power --correct digital --synthesis gates.json --json")[1])
    assert data["lcs"]["converter_parts"]["logic"] == pytest.approx(1e-7 + 1e-6 + 1e-13 * 2429 * 16)
    data = json.loads(call("power --parameters --json")[1])
    assert data["parameters"]["io_voltage_v"]["unit"] == "V"
    assert list(data["corrections"]) == list(CORRECTIONS)
    assert "supply_v" in call("power --parameters")[1]


def test_power_measures_a_dataset_that_is_given(call, folder):
    for texture in open_dataset("embedded").limit(2):
        (folder / "textures" / texture.class_name).mkdir(parents=True)
        Image.fromarray(texture.load()).save(folder / "textures" / f"{texture.name}.png")
    data = json.loads(call("power --correct event_rates --dataset textures --preset physical --json")[1])
    scan = preset("physical")
    measured = measure_rates(open_dataset("textures"), scan, scan.configure(ReadoutConfig(resolution=6)))
    assert data["lcs"]["io"] == pytest.approx(9 * 125e-12 * measured.population_rate_hz)


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({}, "a synthesis report needs the field 'readout'; docs/guide/power.md lists all fields"),
        ([], "a synthesis report must be a JSON object, not list"),
        (REPORT | {"leakage_w": -1}, "leakage_w must be in 0..1000, not -1.0"),
        (REPORT | {"clock_hz": 0}, "clock_hz must be positive, not 0"),
        (REPORT | {"area_um2": "big"}, "area_um2 must be of type float, not 'big'"),
        (REPORT | {"readout": "adc"}, "readout must be one of nlcs, lcs, frame, not 'adc'"),
        (REPORT | {"rows": 0}, "rows must be in 1..64, not 0"),
        (REPORT | {"clock_power_w_per_hz": 1e20}, "clock_power_w_per_hz must be in 0..1e-06, not 1e+20"),
    ],
)
def test_a_broken_synthesis_report_is_one_sentence(refuses, folder, values, sentence):
    (folder / "gates.json").write_text(json.dumps(values))
    refuses(f"error: synthesis report gates.json: {sentence}\n", "power --correct digital --synthesis gates.json")


def test_two_reports_of_one_readout_are_refused(refuses, folder):
    for name in ("a.json", "b.json"):
        (folder / name).write_text(json.dumps(REPORT))
    sentence = "error: b.json is a second synthesis report of readout lcs; give one report for each readout\n"
    refuses(sentence, "power --correct digital --synthesis a.json --synthesis b.json")
    (folder / "a.json").write_text(f'{{"readout": "lcs", "clock_hz": {10**400}}}')
    sentence = "error: the synthesis report a.json is not JSON: it contains a number of 401 digits\n"
    refuses(sentence, "explore --synthesis a.json")


def without_origin(kept: dict[str, Any]) -> dict[str, Any]:
    """Return the stored result without command, commit and date."""
    assert all(kept.pop(name) for name in ("command", "commit", "date"))
    return kept


# -- explore -----------------------------------------------------------------------------------------


@pytest.mark.command("explore")
def test_explore_names_the_cheapest(call, folder):
    code, out, _ = call("explore --rows 12 --columns 16 --event-rate 3000 --bandwidth 500 --noise 1e-3 --json")
    data = json.loads(out)
    assert code == 0
    assert data == without_origin(json.loads((folder / "out/explore.json").read_text()))
    assert (folder / "out/explore.png").stat().st_size > 5_000
    assert (data["noise_resolution"], data["least_resolution"]) == (7, 7)
    totals = {(row["resolution"], r): row[r]["total"] for row in data["table"] for r in READOUTS}
    allowed = {key: total for key, total in totals.items() if key[0] >= 7}
    best = min(allowed, key=allowed.__getitem__)
    assert (data["cheapest"]["resolution"], data["cheapest"]["readout"]) == best
    for row in data["table"]:
        assert row["cheapest"] == min(READOUTS, key=lambda r: row[r]["total"])


def test_explore_is_the_consistent_model(call):
    line = "explore --event-rate 5000 --nlcs-event-rate 800 --rate-resolution 4 --pads-voltage 3.3 --json"
    data = json.loads(call(f"{line} --bandwidth 300 --supply 1.2 --pads-toggle 1 --tau 0.5")[1])
    parameters = PowerParameters(signal_bandwidth_hz=300, supply_v=1.2, pads_voltage_v=3.3, pads_toggle=1)
    model = PowerModel(parameters=parameters, corrections=frozenset(CORRECTIONS), measured=GivenRates(5000.0, 800.0, 4))
    for readout in READOUTS:
        assert data["table"][7][readout] == model.breakdown(readout, 8, 1e-3, 0.5).to_dict()


def test_explore_without_options_and_with_a_silent_sensor(call):
    code, out, _ = call("explore")
    assert (code, "cheapest with at least 7 bit: frame at 7 bit" in out) == (0, True)
    code, out, _ = call("explore --event-rate 0 --min-resolution 9")
    assert (code, "LCS at 9 bit" in out) == (0, True)


# -- event rates -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def measured() -> RateTable:
    return measure_table(open_dataset("embedded").limit(2), preset("paper"), resolutions=(4, 6), taus_s=(0.2, 0.02))


def test_measured_rates_are_those_of_the_rates_command(measured):
    data, scan = open_dataset("embedded").limit(2), preset("paper")
    for n in (4, 6):
        lcs = measure_rates(data, scan, scan.configure(ReadoutConfig(resolution=n)))
        assert measured.population_hz("lcs", n) == pytest.approx(lcs.population_rate_hz)
        for tau in (0.2, 0.02):
            config = scan.configure(ReadoutConfig(encoding="nlcs", resolution=n), tau)
            assert measured.population_hz("nlcs", n, tau) == pytest.approx(
                measure_rates(data, scan, config).population_rate_hz
            )


def test_a_table_is_read_back(measured, tmp_path):
    path = tmp_path / "rates.json"
    path.write_text(json.dumps({"tables": [measured.to_dict(), measured.to_dict()]}))
    first, second = load_tables(path)
    assert first.to_dict() == second.to_dict() == measured.to_dict()
    np.testing.assert_allclose(first.nlcs_hz, measured.nlcs_hz, rtol=1e-4)


def test_rates_between_time_constants_lie_between_and_scale_with_taxels(measured):
    def rate(tau: float, taxels: int = 64) -> float:
        return float(measured.taxel_rates("nlcs", np.array(6.0), np.array(tau), taxels).population_hz)

    assert rate(0.2) < rate(0.1) < rate(0.05) < rate(0.02)
    assert rate(0.1, 192) == pytest.approx(3 * rate(0.1))
    assert rate((0.2 * 0.02) ** 0.5) == pytest.approx((rate(0.2) * rate(0.02)) ** 0.5)
    alone = dataclasses.replace(measured, taus_s=measured.taus_s[:1], nlcs_hz=measured.nlcs_hz[:1])
    assert alone.population_hz("nlcs", 6, measured.taus_s[0]) == pytest.approx(rate(measured.taus_s[0]))


def test_rates_that_were_not_measured_are_refused(measured):
    with pytest.raises(
        InputError, match=r"^there are no measured event rates of 5 b, only of 4, 6; give --dataset to measure them"
    ):
        measured.taxel_rates("lcs", np.array([4.0, 5.0]), np.array([0.2, 0.2]), 64)
    with pytest.raises(InputError, match=r"^there are no measured event rates at tau 2 s, only from 0.02 to 0.2 s"):
        measured.taxel_rates("nlcs", np.array(4.0), np.array(2.0), 64)


@pytest.mark.parametrize("damage", [{"lcs_hz": [[1.0]]}, {"rows": None}, {"taus_s": [1.0]}, {"nlcs_hz": "many"}])
def test_a_damaged_table_is_refused(measured, damage):
    with pytest.raises(InputError, match=r"^a table of event rates is damaged"):
        RateTable.from_dict(measured.to_dict() | damage)


def test_stored_rates_are_the_published_ones():
    assert RATES.population_hz("lcs", 6) == pytest.approx(99_110.9, rel=0.02)
    assert RATES.population_hz("nlcs", 8, 0.2) == pytest.approx(49_640, rel=0.02)
    assert {(t.dataset, t.preset) for t in load_tables()} == {
        (d, p) for d in ("kylberg", "embedded") for p in ("paper", "physical")
    }
    assert {(table.taus_s, table.resolutions) for table in load_tables()} == {(TAUS_S, RESOLUTIONS)}


def test_stored_rates_of_the_embedded_textures_are_measured_again():
    kept = stored_table("physical", "embedded")
    fresh = measure_table(open_dataset("embedded"), preset("physical"), resolutions=(2, 6), taus_s=(0.2,))
    assert kept.bandwidth_hz == fresh.bandwidth_hz
    np.testing.assert_allclose(kept.lcs_hz[[1, 5]], fresh.lcs_hz, rtol=1e-4)
    np.testing.assert_allclose(kept.nlcs_hz[1][[1, 5]], fresh.nlcs_hz[0], rtol=1e-4)


def test_a_file_of_event_rates_is_of_one_preset(call, refuses, folder):
    table = load_tables()[-1]
    (folder / "rates.json").write_text(json.dumps({"tables": [table.to_dict() | {"preset": "physical"}]}))
    data = json.loads(call("power --correct event_rates --preset physical --rates rates.json --json")[1])
    assert data["lcs"]["io"] == pytest.approx(9 * 125e-12 * table.population_hz("lcs", 6))
    sentence = "error: rates.json has no event rates of preset paper; measure them or choose another --preset\n"
    refuses(sentence, "power --mode consistent --rates rates.json")
