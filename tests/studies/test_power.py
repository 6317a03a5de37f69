"""Test the studies fig6, fig7, sensitivity, event_rates and counts, and their data in the documents."""

import dataclasses
import json

import pytest

from eskin.power.equations import CORRECTIONS, PowerModel
from eskin.power.rates import load_tables, stored_table
from eskin.power.readouts import READOUTS
from eskin.power.synthesis import SynthesisReport
from eskin.skin.textures.dataset import embedded_dataset
from eskin.skin.textures.presets import preset
from studies import event_rates, fig6, fig7, sensitivity
from studies.study import ROOT

DOCS = ROOT / "docs"
MODELS = {
    "paper": PowerModel(),
    "consistent": PowerModel(corrections=frozenset(CORRECTIONS), measured=stored_table("paper")),
}


@pytest.mark.quick
def test_fig6_data_are_the_model(folder):
    of_model, *_ = fig6.RESULTS
    path, figure = of_model.make("fig6", folder)
    _, again = of_model.make("fig6", folder / "again")
    data = json.loads(path.read_text())
    assert figure.stat().st_size > 10_000
    assert figure.read_bytes() == again.read_bytes()
    assert data["noise_v_rms"] == pytest.approx([1e-4, 0.924e-3, 1e-2], rel=1e-3)
    for mode, model in MODELS.items():
        for noise, entry in zip(fig6.NOISE_V, data["modes"][mode], strict=True):
            for readout in READOUTS:
                assert entry[readout] == model.breakdown(readout, 6, noise, 0.2).to_dict()


def test_fig7_data_are_the_model(folder):
    path, figure = fig7.RESULT.make("fig7", folder)
    assert figure.stat().st_size > 10_000
    data = json.loads(path.read_text())
    for mode, model in MODELS.items():
        entry = data["modes"][mode]
        for i, n in enumerate(data["resolution"]):
            assert entry["crossover"]["lcs"][i] == model.crossover("lcs", n).noise_v_rms
            assert entry["spikes_win"]["nlcs"]["0.02"][i] == model.crossover("nlcs", n, 0.02).spikes_win
            ratio = model.breakdown("nlcs", n, 1e-3, 2.0).total / model.breakdown("frame", n, 1e-3).total
            assert entry["ratio"]["nlcs"]["2.0"][i] == pytest.approx(float(ratio))


def test_sensitivity_has_every_correction_alone_and_left_out():
    data = sensitivity.compute()
    rows = {row["case"]: row for row in data["rows"]}
    for name in CORRECTIONS:
        assert rows[name]["corrections"] == [name]
        assert set(rows[f"all but {name}"]["corrections"]) == set(CORRECTIONS) - {name}
    frame = PowerModel().breakdown("frame", 6, 1e-4).total
    assert rows["none (paper)"]["ratio"]["lcs"][0] == pytest.approx(
        PowerModel().breakdown("lcs", 6, 1e-4).total / frame
    )


@pytest.mark.parametrize(
    "result", [fig6.RESULTS[0], fig7.RESULT, sensitivity.RESULT], ids=lambda result: str(result.name)
)
def test_the_data_in_the_documentation_are_of_this_model(result):
    kept = json.loads((DOCS / "data" / f"{result.name}.json").read_text())
    assert _numbers(kept) == pytest.approx(_numbers(json.loads(json.dumps(result.compute()))), rel=1e-9)
    assert (DOCS / "figures" / f"{result.name}.png").is_file()


@pytest.mark.parametrize("library", ["ihp", "osu"])
def test_fig6_with_measured_logic_is_that_of_the_netlists_in_the_documentation(library):
    folder = DOCS / "data" / "asic"
    gates = {}
    for readout in ("lcs", "nlcs", "frame"):
        kind = readout if readout == "frame" else f"{readout}-analog"
        gates[readout] = SynthesisReport.from_dict(json.loads((folder / f"{kind}-8x8-{library}.json").read_text()))
    models = {mode: dataclasses.replace(model, gates=gates) for mode, model in MODELS.items()}
    kept = json.loads((folder / library / "fig6.json").read_text())
    expected = _numbers(json.loads(json.dumps(fig6.fig6_data(models))))
    assert _numbers(kept) == pytest.approx(expected, rel=1e-9)
    assert _numbers(json.loads(json.dumps(fig6.compute(library)))) == expected


def _numbers(data: object) -> list[float]:
    """Return all numbers in JSON data, in order."""
    if isinstance(data, dict):
        return [n for value in data.values() for n in _numbers(value)]
    if isinstance(data, list):
        return [n for value in data for n in _numbers(value)]
    return [data] if isinstance(data, (int, float)) else []


def test_event_rates_are_a_file_that_power_reads(call, folder, monkeypatch):
    monkeypatch.setattr(event_rates, "open_dataset", lambda _: embedded_dataset().limit(1))
    monkeypatch.setattr(event_rates, "PRESETS", {"physical": preset("physical")})
    (path,) = event_rates.RESULT.make("event_rates", folder)
    data = json.loads(call("power --correct event_rates --preset physical --json --rates", path)[1])
    (table,) = load_tables(path)
    assert data["lcs"]["io"] == pytest.approx(9 * 125e-12 * table.population_hz("lcs", 6))
    assert len(path.read_text().splitlines()) < 100, "a list of taxels is a line"
