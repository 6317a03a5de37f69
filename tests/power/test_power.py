"""Test the power model: published numbers, invariants, corrections and crossovers."""

import dataclasses
import math
from collections.abc import Iterable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eskin.base.errors import InputError
from eskin.power.build import chosen_corrections
from eskin.power.equations import CORRECTIONS, LARGEST, SMALLEST, Breakdown, PowerModel, TaxelRates
from eskin.power.explore import GivenRates
from eskin.power.parameters import PowerParameters
from eskin.power.rates import TAUS_S, stored_table
from eskin.power.readouts import READOUTS, SPIKING, equations_of
from eskin.power.synthesis import SynthesisReport

PAPER = PowerModel()
RATES = stored_table("paper")
CONSISTENT = PowerModel(corrections=frozenset(CORRECTIONS), measured=RATES)

REPORT = SynthesisReport(
    readout="lcs",
    rows=8,
    columns=8,
    clock_hz=1e6,
    area_um2=1e5,
    leakage_w=1e-7,
    clock_power_w_per_hz=1e-12,
    energy_per_event_j=1e-13,
)

resolutions = st.integers(1, 10)
noises = st.floats(1e-6, 1e-1)
taus = st.floats(0.02, 2.0)
readouts = st.sampled_from(READOUTS)
choices = st.sets(st.sampled_from(sorted(CORRECTIONS))).map(frozenset)


def with_corrections(chosen: Iterable[str], **parameters: float) -> PowerModel:
    return PowerModel(corrections=frozenset(chosen), measured=RATES, parameters=PowerParameters().replace(**parameters))


def at(model: PowerModel, readout: str, resolution: int = 6) -> Breakdown:
    """Return the power at 1 mV."""
    return model.breakdown(readout, resolution, 1e-3)


@pytest.mark.parametrize(
    ("noise", "readout", "afe", "converter", "io", "total"),
    [
        (1e-4, "nlcs", 2.686e-2, 6.47e-5, 1.204e-5, 2.694e-2),
        (1e-4, "lcs", 2.686e-2, 2.11e-6, 4.372e-5, 2.691e-2),
        (1e-4, "frame", 4.18e-6, 8.19e-7, 9.600e-4, 9.650e-4),
        (1e-2, "nlcs", 2.69e-6, 6.47e-5, 1.204e-5, 7.94e-5),
        (1e-2, "lcs", 2.69e-6, 2.11e-6, 4.372e-5, 4.85e-5),
        (1e-2, "frame", 4.2e-10, 8.19e-7, 9.600e-4, 9.608e-4),
    ],
)
def test_paper_mode_gives_figure_6(noise, readout, afe, converter, io, total):
    found = PAPER.breakdown(readout, 6, noise, 0.2)
    parts = [float(part) for part in (found.afe, found.converter, found.io, found.total)]
    assert parts == pytest.approx([afe, converter, io, total], rel=0.01)


@pytest.mark.parametrize(
    ("readout", "expected"),
    [
        ("lcs", [1.23e-4, 1.50e-4, 2.01e-4, 2.76e-4, 3.85e-4, 5.42e-4]),
        ("nlcs", [1.22e-4, 1.50e-4, 2.00e-4, 2.75e-4, 3.85e-4, 5.51e-4]),
    ],
)
def test_paper_mode_gives_figure_7(readout, expected):
    found = [PAPER.crossover(readout, n, 0.2) for n in range(1, 7)]
    assert [c.noise_v_rms for c in found] == pytest.approx(expected, rel=0.01)
    assert {c.spikes_win for c in found} == {"above"}


def test_paper_mode_lines_of_figure_7_end_where_converter_and_io_exceed_frames():
    for readout, tau, last in (("lcs", 0.2, 10), ("nlcs", 2.0, 10), ("nlcs", 0.2, 8), ("nlcs", 0.02, 5)):
        found = [PAPER.crossover(readout, n, tau).noise_v_rms is not None for n in range(1, 11)]
        assert found == [n <= last for n in range(1, 11)]
        spiking, frame = (PAPER.breakdown(name, range(1, 11), 1e3, tau).total for name in (readout, "frame"))
        assert (spiking < frame).tolist() == found


def test_paper_mode_afe_is_worth_the_published_noise_efficiency():
    unit = with_corrections({"afe_nef"}, noise_efficiency=1)
    assert math.sqrt(at(PAPER, "lcs").afe / at(unit, "lcs").afe) == pytest.approx(158, rel=0.01)


def test_consistent_mode_is_against_spikes_at_six_bits_and_for_leaky_ones_at_four():
    """Check the result that docs/results/power.md states."""
    for readout, n, ratio in (("lcs", 6, 22.6), ("nlcs", 6, 3.66), ("nlcs", 4, 0.886)):
        found = at(CONSISTENT, readout, n).total / at(CONSISTENT, "frame", n).total
        assert found == pytest.approx(ratio, rel=0.01)


def test_parts_of_the_lcs_converter_by_hand():
    for per_second in (2429.0, 0.3):
        p = PowerParameters(lcs_rate_2b_hz=per_second)
        parts, rate = at(PowerModel(parameters=p), "lcs").converter_parts, per_second * 16
        assert parts["comparator_dynamic"] == pytest.approx(2 * p.comparator_dynamic_f * p.supply_v**2 * rate)
        assert parts["logic"] == pytest.approx(p.logic_f * p.supply_v**2 * p.lines * rate / p.logic_share)
        assert parts["dac"] == pytest.approx(32 * p.dac_unit_f * p.supply_v**2 * 0.5 * rate)


@pytest.mark.parametrize("readout", SPIKING)
def test_switching_power_grows_with_the_square_of_the_supply(readout):
    low, high = (at(with_corrections((), supply_v=volts), readout).converter_parts for volts in (1.0, 2.0))
    assert high["comparator_dynamic"] == pytest.approx(4 * low["comparator_dynamic"])


@settings(deadline=None, max_examples=60)
@given(readouts, resolutions, noises, taus, choices)
def test_totals_are_the_sum_of_positive_parts(readout, n, noise, tau, chosen):
    found = with_corrections(chosen).breakdown(readout, n, noise, tau)
    parts = [found.afe, *found.converter_parts.values(), found.io]
    assert all(part > 0 for part in parts)
    assert found.total == pytest.approx(math.fsum(parts), rel=1e-12)
    assert found.converter == pytest.approx(found.total - found.afe - found.io, rel=1e-6, abs=1e-18)


@settings(deadline=None, max_examples=60)
@given(readouts, resolutions, noises, st.floats(1.5, 100), choices)
def test_afe_power_falls_with_the_square_of_the_noise_and_nothing_else_does(readout, n, noise, factor, chosen):
    model = with_corrections(chosen)
    quiet, loud = model.breakdown(readout, n, noise), model.breakdown(readout, n, noise * factor)
    assert quiet.afe == pytest.approx(loud.afe * factor**2, rel=1e-9)
    assert quiet.io == loud.io
    assert quiet.converter_parts == loud.converter_parts


@settings(deadline=None, max_examples=40)
@given(resolutions, noises, taus, st.floats(0.1, 100), choices)
def test_frame_power_does_not_depend_on_events(n, noise, tau, factor, chosen):
    busy = {"lcs_rate_2b_hz": 2429.0 * factor, "nlcs_rate_4b_hz": 3009.6 * factor}
    calm, many = with_corrections(chosen), with_corrections(chosen, **busy)
    assert calm.breakdown("frame", n, noise, 0.2).total == many.breakdown("frame", n, noise, tau).total
    for readout in SPIKING if "event_rates" not in chosen and factor > 1 else ():
        assert many.breakdown(readout, n, noise).total > calm.breakdown(readout, n, noise).total


@settings(deadline=None, max_examples=40)
@given(noises, taus, choices)
def test_power_never_falls_with_the_resolution_and_spiking_power_with_a_shorter_tau(noise, tau, chosen):
    model = with_corrections(chosen)
    for readout in READOUTS:
        assert (np.diff(model.breakdown(readout, range(1, 11), noise, tau).total) > 0).all()
    # of the measured rates short time constants lose events at coarse steps, never so many
    shorter = model.breakdown("nlcs", range(4, 11), noise, max(tau / 2, 0.02))
    longer = model.breakdown("nlcs", range(4, 11), noise, tau)
    assert (shorter.total >= longer.total * (1 - 1e-12)).all()


@settings(deadline=None, max_examples=60)
@given(st.sampled_from(SPIKING), resolutions, taus, choices)
def test_a_crossover_is_a_root_and_its_side_is_right(readout, n, tau, chosen):
    model = with_corrections(chosen)
    found = model.crossover(readout, n, tau)

    def ratio(noise: float) -> float:
        """Return the power of spikes in terms of that of frames."""
        spiking, frame = (model.breakdown(r, n, noise, tau).total for r in (readout, "frame"))
        return float(spiking / frame)

    if found.noise_v_rms is None:
        for noise in (1e-6, 1e-4, 1e-2):
            assert (ratio(noise) < 1) == (found.spikes_win == "always")
        return
    assert ratio(found.noise_v_rms) == pytest.approx(1, rel=1e-9)
    assert (ratio(found.noise_v_rms * 1.1) < 1) == (found.spikes_win == "above")
    assert (ratio(found.noise_v_rms / 1.1) < 1) == (found.spikes_win == "below")


def test_arrays_give_what_single_numbers_give():
    bits, noise, tau = np.arange(1, 11)[:, None, None], np.array([1e-4, 1e-2])[:, None], np.array([2.0, 0.1, 0.02])
    for model in (PAPER, CONSISTENT):
        for readout in READOUTS:
            found = model.breakdown(readout, bits, noise, tau)
            assert found.afe.shape == found.converter.shape == found.io.shape == found.total.shape == (10, 2, 3)
            single = model.breakdown(readout, 7, 1e-2, 0.1)
            assert found.total[6, 1, 1] == pytest.approx(single.total, rel=1e-12)


def alone(name: str, readout: str, **parameters: float) -> tuple[dict, dict]:
    return tuple(at(with_corrections(chosen, **parameters), readout).to_dict() for chosen in ((), (name,)))


def test_every_correction_changes_something():
    changed = {name: [r for r in READOUTS if alone(name, r)[0] != alone(name, r)[1]] for name in CORRECTIONS}
    assert changed == {
        "afe_settling": ["frame"],
        "event_rates": ["nlcs", "lcs"],
        "comparators": ["nlcs"],  # M comparators at 1/M of the rate cost what one costs: nothing changes for LCS
        "bandwidth": ["nlcs", "lcs", "frame"],
        "pads": ["nlcs", "lcs", "frame"],
        "afe_nef": ["nlcs", "lcs", "frame"],
        "digital": ["nlcs", "lcs"],
    }


def test_the_shared_afe_settles_once_for_every_taxel():
    before, after = alone("afe_settling", "frame")
    assert after["afe"] == pytest.approx(64 * before["afe"])
    assert (after["converter"], after["io"]) == (before["converter"], before["io"])


def test_event_rates_come_from_the_encoders():
    for readout, ratio in (("lcs", 99_231.9 / (2429 * 16)), ("nlcs", 12_361.5 / (3009.6 * 4))):
        before, after = alone("event_rates", readout)
        assert after["io"] / before["io"] == pytest.approx(ratio, rel=1e-3)


def test_a_comparator_at_its_own_rate_takes_the_share_of_its_taxel():
    before, after = alone("comparators", "nlcs")
    for part in ("v_to_i", "comparator_static", "decay_filter"):
        assert after["converter_parts"][part] == pytest.approx(before["converter_parts"][part] / 64)
    for part in ("comparator_dynamic", "line_bias", "logic"):
        assert after["converter_parts"][part] == before["converter_parts"][part]


def test_unequal_taxels_cost_more_in_the_decay_filter_only():
    rate, found = np.array(1000.0), []
    for rates in (TaxelRates(rate, rate**2), TaxelRates.uniform(rate, 64)):  # of the first, one taxel makes all events
        source = SimpleNamespace(taxel_rates=lambda *_, rates=rates: rates)
        found.append(at(PowerModel(corrections=frozenset({"comparators", "event_rates"}), measured=source), "nlcs"))
    one, all_ = found
    differing = [k for k in one.converter_parts if one.converter_parts[k] != all_.converter_parts[k]]
    assert differing == ["decay_filter"]
    assert one.total > all_.total


def test_the_frame_rate_follows_the_signal():
    for readout, slower in (("frame", ("afe", "converter", "io")), ("lcs", ("afe",))):
        before, after = alone("bandwidth", readout)
        for part in ("afe", "converter", "io"):
            assert after[part] == pytest.approx(before[part] * (97 / 10e3 if part in slower else 1))


@pytest.mark.parametrize("volts", [5.0, 3.3, 1.8])
@pytest.mark.parametrize("toggle", [1.0, 0.5])
def test_pads_follow_their_supply_and_toggling_but_request_and_acknowledge_always_rise(volts, toggle):
    charge = (volts / 5) ** 2
    for readout, data_bits in (("lcs", 7), ("nlcs", 6)):
        before, after = alone("pads", readout, pads_voltage_v=volts, pads_toggle=toggle)
        assert after["io"] == pytest.approx(before["io"] * charge * (data_bits * toggle + 2) / (data_bits + 2))
    before, after = alone("pads", "frame", pads_voltage_v=volts, pads_toggle=toggle)
    assert after["io"] == pytest.approx(before["io"] * charge * toggle)


def test_the_afe_by_noise_efficiency():
    p = PowerParameters()
    expected = 64 * 16 * 2 * math.pi * p.thermal_energy_j * p.thermal_voltage_v * 10e3 / (1e-3 / 5) ** 2
    assert alone("afe_nef", "nlcs")[1]["afe"] == pytest.approx(expected)
    assert alone("afe_nef", "frame")[1]["afe"] == pytest.approx(expected / 64)


def test_a_shared_afe_may_need_more_bandwidth_than_its_samples():
    model = with_corrections({"afe_nef", "afe_settling"}, shared_afe_bandwidth=15.0)
    plain = with_corrections({"afe_nef", "afe_settling"})
    assert at(model, "frame").afe == pytest.approx(15 * at(plain, "frame").afe)
    assert at(plain, "frame").afe == pytest.approx(at(plain, "lcs").afe)
    assert at(model, "lcs").afe == at(plain, "lcs").afe


def test_digital_power_is_the_published_energy_per_event_or_that_of_the_netlist():
    rate = 2429.0 * 16
    assert alone("digital", "lcs")[1]["converter_parts"]["logic"] == pytest.approx(435e-15 * rate)
    model = PowerModel(corrections=frozenset({"digital"}), gates={"lcs": REPORT})
    expected = 1e-7 + 1e-12 * 1e6 + 1e-13 * rate
    assert at(model, "lcs").converter_parts["logic"] == pytest.approx(expected)
    # without its own report a readout keeps the published energy
    assert at(model, "nlcs").converter_parts["logic"] == pytest.approx(435e-15 * 3009.6 * 4)


def test_a_netlist_is_scaled_by_taxels_and_clocked_as_fast_as_its_events():
    assert float(REPORT.power_w(128, 0.0)) == pytest.approx(2 * (1e-7 + 1e-6))
    assert float(REPORT.power_w(64, 4e6)) == pytest.approx(1e-7 + 4e-6 + 4e-7)


def test_a_lone_event_may_cost_more_and_more_events_never_draw_less():
    report = dataclasses.replace(REPORT, energy_per_lone_event_j=3 * REPORT.energy_per_event_j)
    rates = np.linspace(0, 2 * REPORT.clock_hz, 50)
    assert (np.diff(report.power_w(64, rates)) > 0).all()
    few, many = 1.0, 4 * REPORT.clock_hz
    idle = float(report.power_w(64, 0.0))
    assert float(report.power_w(64, few)) - idle == pytest.approx(3 * REPORT.energy_per_event_j, rel=1e-4)
    assert float(report.power_w(64, many)) == pytest.approx(float(REPORT.power_w(64, many)))
    frame = dataclasses.replace(REPORT, readout="frame")
    model = PowerModel(corrections=frozenset({"digital"}), gates={"frame": frame})
    samples_hz = 2 * 10e3 * 64
    expected = 1e-7 + 1e-12 * samples_hz + 1e-13 * samples_hz
    assert at(model, "frame").converter_parts["logic"] == pytest.approx(expected)


def test_a_reference_that_leaks_in_the_netlist_pays_for_no_decay_filter():
    analog = dataclasses.replace(REPORT, readout="nlcs")
    found = {}
    for leak in ("analog", "digital"):
        gates = {"nlcs": dataclasses.replace(analog, leak=leak)}
        found[leak] = at(PowerModel(corrections=frozenset({"digital"}), gates=gates), "nlcs").converter_parts
        off = at(PowerModel(gates=gates), "nlcs")  # nothing of a report without the correction
        assert off.converter_parts.keys() == at(PAPER, "nlcs").converter_parts.keys()
    assert set(found["analog"]) ^ set(found["digital"]) == {"decay_filter", "dac"}
    rate, code = 3009.6 * 4, 32
    assert found["digital"]["dac"] == pytest.approx(code * PowerParameters().dac_unit_f * 0.5 * rate)
    with pytest.raises(InputError, match=r"^leak must be one of analog, digital, not 'none'$"):
        dataclasses.replace(analog, leak="none")


def test_arrays_of_other_shapes():
    square, flat = PowerParameters(rows=8, columns=8), PowerParameters(rows=1, columns=64)
    assert (square.address_bits, square.lines, flat.address_bits, flat.lines) == (6, 16, 6, 65)
    one = PowerModel(parameters=PowerParameters(rows=1, columns=1))
    assert at(one, "lcs").afe == pytest.approx(at(PAPER, "lcs").afe / 64)
    assert at(one, "nlcs").io == pytest.approx(2 * 125e-12 * 3009.6 * 4 / 64)


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: PAPER.breakdown("lcs", 11, 1e-3), "resolution must be a whole number in 1..10, not 11"),
        (lambda: PAPER.breakdown("lcs", [6, 0], 1e-3), "resolution must be a whole number in 1..10, not 0"),
        (lambda: PAPER.breakdown("lcs", 6.5, 1e-3), "resolution must be a whole number in 1..10, not 6.5"),
        (lambda: PAPER.breakdown("lcs", 6, -1e-3), "noise must be a positive number of volts, not -0.001"),
        (lambda: PAPER.breakdown("lcs", 6, math.nan), "noise must be a positive number of volts, not nan"),
        (lambda: PAPER.breakdown("lcs", 6, SMALLEST / 2), "noise must be in 1e-15..1e+15 volts, not 5e-16"),
        (lambda: PAPER.breakdown("lcs", 6, LARGEST * 2), "noise must be in 1e-15..1e+15 volts, not 2e+15"),
        (lambda: PAPER.breakdown("nlcs", 6, 1e-3, 0.0), "tau must be a positive number of seconds, not 0"),
        (lambda: PAPER.breakdown("cw-lcs", 6, 1e-3), "readout must be one of nlcs, lcs, frame, not 'cw-lcs'"),
        (lambda: PAPER.crossover("frame", 6), "a crossover needs a spiking readout, nlcs or lcs, not 'frame'"),
        (
            lambda: PowerModel(corrections=frozenset({"magic"})),
            f"unknown correction 'magic'; known are {', '.join(CORRECTIONS)}",
        ),
        (
            lambda: PowerModel(corrections=frozenset({"event_rates"})),
            "correction event_rates needs measured rates; measure them or leave it out",
        ),
        (lambda: PowerParameters(supply_v=0), "supply_v must be a positive number in V, not 0.0"),
        (lambda: PowerParameters(afe_gain=math.inf), "afe_gain must be a positive number, not inf"),
        (lambda: PowerParameters(io_toggle=1.5), "io_toggle is a share and must be at most 1, not 1.5"),
        (lambda: PowerParameters(rows=65), "rows must be in 1..64, not 65"),
        (lambda: PowerParameters(supply_v="1"), "supply_v must be of type float, not '1'"),
        (
            lambda: PowerParameters().replace(volts=3),
            "unknown parameter 'volts'; eskin power --parameters lists them",
        ),
        (
            lambda: CONSISTENT.breakdown("nlcs", 6, 1e-3, 5.0),
            "there are no measured event rates at tau 5 s, only from 0.02 to 2 s; give --dataset to measure them",
        ),
    ],
)
def test_bad_input_is_one_sentence(call, sentence):
    with pytest.raises(InputError) as caught:
        call()
    assert str(caught.value) == sentence


def test_every_parameter_has_a_source_and_a_meaning():
    for field in dataclasses.fields(PowerParameters):
        assert field.metadata["source"]
        assert field.metadata["meaning"]
    assert set(TAUS_S) == {2.0, 0.2, 0.02}


@pytest.mark.parametrize("name", ["cw-lcs", "pcm"])
def test_an_encoder_without_published_rates_has_none(name: Any) -> None:
    for rates in (RATES, GivenRates(1.0, 1.0, 6)):
        with pytest.raises(InputError, match=f"^the power model has equations of nlcs and lcs only, not of {name}$"):
            rates.taxel_rates(name, np.array(6.0), np.array(0.2), 64)


def test_an_encoder_takes_its_own_equations_or_those_of_lcs() -> None:
    assert {name: equations_of(name) for name in ("lcs", "cw-lcs", "nlcs")} == {
        "lcs": "lcs",
        "cw-lcs": "lcs",
        "nlcs": "nlcs",
    }
    with pytest.raises(InputError, match=r"^the power model has equations of lcs, cw-lcs, nlcs only, not of pcm$"):
        equations_of("pcm")


def test_corrections_follow_the_mode_or_a_list() -> None:
    one = min(CORRECTIONS)
    assert chosen_corrections("consistent", None, None) == frozenset(CORRECTIONS)
    assert chosen_corrections("paper", None, None) == chosen_corrections(None, None, None) == frozenset()
    assert chosen_corrections(None, one, None) == {one}
    assert chosen_corrections(None, None, one) == frozenset(CORRECTIONS) - {one}
    for mode, correct, without, sentence in (
        ("paper", one, None, "mode paper has no corrections"),
        ("consistent", one, None, "--correct lists all corrections to make"),
        (None, one, one, "give only one of the two"),
        ("fair", None, None, "mode must be one of"),
    ):
        with pytest.raises(InputError, match=sentence):
            chosen_corrections(mode, correct, without)
