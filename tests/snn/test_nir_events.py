"""Test recordings as NIRData and as arrays for event libraries, with round trip."""

from pathlib import Path
from typing import Any

import nir
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from eskin.base.errors import InputError
from eskin.model.address_events import EVENT_DTYPE, make_events
from eskin.model.config import ReadoutConfig
from eskin.model.encoders import registry
from eskin.model.events.recording import Recording
from eskin.skin.foreign.events import in_unit
from eskin.snn.data.bins import BinConfig, bin_recording
from eskin.snn.exchange.nir_events import from_nir_data, load_nir_data, save_nir_data, to_nir_data
from eskin.snn.exchange.nir_network import to_nir
from tests.snn.helpers import some_weights

READOUT = ReadoutConfig(rows=2, columns=3, sample_rate_hz=17_001.0)


def recording(config: ReadoutConfig = READOUT, offset: int = 0) -> Recording:
    generator = np.random.default_rng(7)
    t = np.sort(generator.integers(0, 300_000, 500)) + offset
    polarity = generator.random(500) < 0.5 if config.has_polarity else True
    events = make_events(t, generator.integers(0, 2, 500), generator.integers(0, 3, 500), polarity)
    return Recording(events, config, 300_000 + offset, metadata={"name": "brick", "class": "stone"})


@pytest.mark.parametrize("encoding", registry.NAMES)
def test_events_come_back_from_nir_data(tmp_path: Path, encoding: str) -> None:
    original = recording(READOUT.replace(encoding=encoding))
    save_nir_data(tmp_path / "events.nir", original)
    data = nir.read_data(tmp_path / "events.nir")
    events = data.nodes["input"].observables["spikes"]
    assert (events.n_samples, events.n_neurons) == (1, 12 if original.config.has_polarity else 6)
    assert events.t_max == original.duration_s
    assert from_nir_data(data, original.config, original.metadata) == original
    assert load_nir_data(tmp_path / "events.nir") == original


def test_channels_and_times_are_those_of_the_counts() -> None:
    original, bins = recording(), BinConfig(bin_s=0.01)
    events = to_nir_data(original).nodes["input"].observables["spikes"]
    counts = bin_recording(original, bins)
    found = np.zeros_like(counts)
    step = np.floor(events.time[0] / 0.01).astype(int)
    np.add.at(found, (step[step < len(counts)], events.idx[0][step < len(counts)]), 1)
    np.testing.assert_array_equal(found, counts)


def test_counts_and_events_fit_the_graph_of_a_network(tmp_path: Path) -> None:
    original, bins = recording(), BinConfig(bin_s=0.01)
    graph = to_nir(some_weights(step_s=0.01, inputs=12))
    to_nir_data(original).check_nodes(graph)
    save_nir_data(tmp_path / "counts.nir", original, bins)
    data = nir.read_data(tmp_path / "counts.nir")
    data.check_nodes(graph)
    grid = data.nodes["input"].observables["spikes"]
    np.testing.assert_array_equal(grid.data[0], bin_recording(original, bins))
    assert grid.dt == 0.01
    with pytest.raises(InputError, match="must have the observable 'spikes' of type EventData, not TimeGriddedData"):
        load_nir_data(tmp_path / "counts.nir")


@given(
    st.lists(st.integers(0, 2**51 - 1), min_size=1, max_size=20),
    st.floats(1e-3, 1e9),
    st.integers(1, 2**24),
)
def test_every_clock_below_2_to_the_51_survives_the_seconds(t: list[int], rate: float, clocks: int) -> None:
    config = ReadoutConfig(rows=1, columns=1, sample_rate_hz=rate, clocks_per_sample=clocks)
    original = Recording(make_events(sorted(t), 0, 0), config, 2**51)
    assert from_nir_data(to_nir_data(original), config) == original


def test_limits_of_nir_data() -> None:
    assert from_nir_data(to_nir_data(recording(offset=2**40)), READOUT).events["t"].max() >= 2**40
    with pytest.raises(InputError, match=r"more than 2\*\*51; split it"):
        to_nir_data(Recording(make_events(0, 0, 0), READOUT, 2**51 + 1))
    data = to_nir_data(recording())
    with pytest.raises(InputError, match="the data have 12 channels, but the readout has 2"):
        from_nir_data(data, READOUT.replace(rows=1, columns=1))
    events = data.nodes["input"].observables["spikes"]
    events.idx[0, 3] = 12
    with pytest.raises(InputError, match="event 3 has channel 12"):
        from_nir_data(data, READOUT)
    events.idx[0, 3], events.time[0, 3] = -1, np.inf
    assert len(from_nir_data(data, READOUT).events) == 499


def test_the_array_of_event_tools() -> None:
    original = recording()
    array = in_unit(original)
    assert array.dtype == EVENT_DTYPE
    assert array.dtype.names == ("t", "x", "y", "p")
    expected = [round(int(t) * 1e6 / original.clock_hz) for t in original.events["t"]]
    assert array["t"].tolist() == expected
    assert np.array_equal(array[["x", "y", "p"]], original.events[["x", "y", "p"]])
    assert np.array_equal(in_unit(original, "clocks"), original.events)
    with pytest.raises(InputError, match="events are written in us or clocks, not 's'"):
        in_unit(original, "s")


@pytest.mark.command("convert")
def test_events_go_out_and_come_back(eskin: Any, folder: Path) -> None:
    original = recording()
    original.save(Path("e.npz"))
    assert eskin("convert e.npz -o e.nir") == ("e.nir: 500 events in 0.275719 s\n", "")
    eskin("convert e.nir -o back.npz")
    assert Path("back.npz").read_bytes() == Path("e.npz").read_bytes()
    eskin("convert e.npz -o counts.nir --bin 0.01")
    assert nir.read_data("counts.nir").nodes["input"].observables["spikes"].n_time_steps == 27
    eskin("convert e.npz -o e.npy")
    assert np.array_equal(np.load("e.npy"), in_unit(original))
    eskin("convert e.npz -o e.npy --unit clocks")
    assert np.array_equal(np.load("e.npy"), original.events)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("convert none.npz -o e.npy", "cannot read none.npz: No such file or directory"),
        ("convert e.npz -o e.aedat", "events are written as .npz, .aedat4, .nir, .npy, .csv, not e.aedat; rename the"),
        ("convert e.npz -o e.npy --bin 0.01", "--bin is only for .nir, not for e.npy; leave it out"),
        ("convert e.npz -o e.nir --unit us", "--unit is only for .npy and .csv, not for e.nir; leave it out"),
        ("convert e.npz -o e.npy --unit ms", "--unit must be us or clocks, not 'ms'"),
        ("convert e.xyz -o e.npy", "e.xyz has an unknown format; give events as .npz, .nir, .aedat4, or as a table"),
        ("convert broken.nir -o e.npz", "broken.nir is damaged or not NIRData; convert its event file again"),
    ],
)
def test_wrong_commands_are_one_sentence_and_leave_nothing(refuses: Any, line: str, message: str) -> None:
    recording().save(Path("e.npz"))
    Path("broken.nir").write_bytes(b"no HDF5")
    refuses(f"error: {message}", line)


@pytest.mark.parametrize("rate", [1e-9, 1e12])  # the ends of what a configuration takes
def test_events_at_an_absurd_clock_are_converted_or_refused_in_one_sentence(call: Any, rate: float) -> None:
    config = READOUT.replace(sample_rate_hz=rate)
    recording(config).save(Path("a.npz"))
    for out in ("a.nir", "a.npy"):
        code, _, error = call("convert", "a.npz", "-o", out)
        assert code == 0 or (code, error.count("\n")) == (2, 1), error
        assert Path(out).exists() == (code == 0)
    if rate < 1:
        with pytest.raises(InputError, match="too long for microseconds; use clocks"):
            in_unit(Recording(make_events([10**9], [0], [0]), config, 10**9 + 1))
