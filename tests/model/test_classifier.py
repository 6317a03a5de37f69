"""Test the integer network: widths, order of additions, clocks and file."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eskin.base.errors import InputError
from eskin.model.classifier.config import ClassifierConfig, Leak, bits_of, ends, highest, lowest
from eskin.model.classifier.file import ARRAYS, PARAMETERS, IntegerWeights, neuron_image, weight_image, write_images
from eskin.model.classifier.file import network_of as network_from_images
from eskin.model.classifier.network import IntegerNetwork, State, lead
from eskin.model.classifier.run import first_ready, simulate, work_clocks


def network(seed: int = 0, **fields: Any) -> IntegerNetwork:
    base = {"inputs": 6, "hidden": 20, "classes": 3, "lanes": 4, "threshold": 200, "out_threshold": 150}
    config = ClassifierConfig(**(base | {"floor": -200, "out_floor": -150, "clocks_per_bin": 100} | fields))
    generator = np.random.default_rng(seed)

    def drawn(bits: int, *shape: int) -> Any:
        return generator.integers(lowest(bits), highest(bits) + 1, shape)

    return IntegerNetwork.filled(config, drawn)


VARIANTS: list[dict[str, Any]] = [
    {},
    {"neuron_reset": "subtract", "leak_shift": 2, "floor": None, "out_leak_shift": 3},
    {"readout": "membrane", "out_leak_shift": 3, "leak_shift": 1},
    {"in_shift": 2, "rec_shift": 4, "bias_shift": 1, "out_shift": 3},
    {"synapse_shift": 3, "synapse_factor": 3, "leak_shift": 4, "leak_factor": 5, "out_synapse_shift": 1, "floor": None},
    {"own_parameters": True},
]


def test_derived_numbers_by_hand() -> None:
    assert network().config.additions(events=2, spikes=3, bins=4) == 2 * 20 + (3 + 4) * (20 + 3)
    assert [ClassifierConfig(inputs=inputs).channel_bits for inputs in (1, 2, 64, 65, 129)] == [0, 1, 6, 7, 8]


@pytest.mark.parametrize("fields", VARIANTS)
def test_no_potential_ever_leaves_the_ends(fields: dict[str, Any]) -> None:
    """Check the potential ranges with the worst-case events of many bins."""
    own = network(membrane_bits=32, output_bits=32, **fields)
    low, high = own.hidden_ends or (0, 0)
    out_low, out_high = own.output_ends or (0, 0)
    assert bits_of(own.hidden_ends) <= bits_of(own.config.hidden_range) < 32
    assert bits_of(own.output_ends) <= bits_of(own.config.output_range) < 32
    reached = 0
    for sign in (1, -1):
        for neuron in range(own.config.hidden):
            state, channel = State(own), int((sign * own.w_in[:, neuron]).argmax())
            for _ in range(40):
                state.add_events([channel] * own.config.events_per_bin)
                potential, _, output, _ = state.end_bin()
                for values, least, most in ((potential, low, high), (output, out_low, out_high)):
                    assert least <= values.min()
                    assert values.max() <= most
                reached = max(reached, int(potential.max()))
    assert reached > high / 2  # the ends are no wide guess
    sized = own.sized().config
    assert sized.membrane_bits - bits_of((low, high)) in (0, 1)
    assert sized.saturates == (bits_of(sized.hidden_range) > bits_of((low, high)) + 1)


@pytest.mark.parametrize("fields", VARIANTS[:1] + VARIANTS[2:])
def test_ends_are_those_of_the_worst_bin_of_every_neuron(fields: dict[str, Any]) -> None:
    own = network(membrane_bits=32, **fields)
    config, found = own.config, []
    for neuron in range(config.hidden):
        inputs = [int(weight) << config.in_shift for weight in own.w_in[:, neuron]]
        spikes = [int(weight) << config.rec_shift for weight in own.w_rec[:, neuron]]
        bias = int(own.b_hidden[neuron]) << config.bias_shift
        low = config.events_per_bin * min(0, *inputs) + sum(min(0, spike) for spike in spikes) + min(0, bias)
        high = config.events_per_bin * max(0, *inputs) + sum(max(0, spike) for spike in spikes) + max(0, bias)
        found.append(config.hidden_ends(low, high, int(own.threshold[neuron]), int(own.leak[neuron])))
    assert own.hidden_ends == (min(low for low, _ in found), max(high for _, high in found))


def test_equal_own_parameters_change_nothing_but_the_upper_bits_of_two_words() -> None:
    fields = {"leak_shift": 2, "out_leak_shift": 3}
    plain = network(3, **fields)
    arrays = {name: getattr(plain, name) for name in ARRAYS}
    own = IntegerNetwork(plain.config.replace(own_parameters=True), **arrays)
    counts = np.random.default_rng(2).poisson(1.0, (5, 12, own.config.inputs))
    assert own.run_counts(counts)[1] == plain.run_counts(counts)[1] > 0
    assert np.array_equal(own.run_counts(counts)[0], plain.run_counts(counts)[0])
    assert weight_image(own) == weight_image(plain)
    bits, words = plain.config.neuron_bits, neuron_image(own)
    assert [word & (1 << bits) - 1 for word in words] == neuron_image(plain)
    above = {number: word >> bits for number, word in enumerate(words) if word >> bits}
    row = 1 << own.config.neuron_row_bits
    assert above == {n * row + 3: 200 | 2 << 8 for n in range(20)} | {n * row + 4: 150 | 3 << 8 for n in range(3)}


def test_a_threshold_and_a_leak_belong_to_one_neuron() -> None:
    made = network(1, own_parameters=True, evidence_bits=20)
    again = network_from_images(made.config, weight_image(made), neuron_image(made))
    for name in (*ARRAYS, *PARAMETERS):
        assert np.array_equal(getattr(again, name), getattr(made, name)), name
    with pytest.raises(InputError, match=r"^threshold must be in 1\.\.255, not 256$"):
        dataclasses.replace(made, threshold=made.threshold * 0 + 256)
    with pytest.raises(InputError, match=r"^out_leak must be in 0\.\.0 without own parameters, not 1$"):
        dataclasses.replace(network(), out_leak=np.array([0, 1, 0]))


def test_an_early_decision_needs_the_whole_margin_and_stays() -> None:
    assert lead(np.array([[3, 9, 5], [-2, -7, -2], [4, 4, 1]])).tolist() == [4, 0, 0]
    plain = network(3, readout="membrane", evidence_bits=20)
    counts = np.random.default_rng(5).poisson(1.0, (1, 40, plain.config.inputs))
    ahead = [int(lead(state.evidence)[0]) for state in plain.run_bins(counts)]
    margin = max(ahead[:20])
    assert min(ahead[ahead.index(margin) :]) < margin, "the lead shrinks after the decision"
    early = dataclasses.replace(plain, config=plain.config.replace(margin=margin))
    sure = [bool(state.sure[0]) for state in early.run_bins(counts)]
    assert sure == [bin_ >= ahead.index(margin) for bin_ in range(40)]


def test_one_group_that_reads_itself_is_a_network_without_layers() -> None:
    assert network(layers=[[0, 20, [0]]]).config == network().config


def test_a_stack_has_words_and_clocks_for_connected_groups_alone() -> None:
    made = network(2, own_parameters=True, layers=[[0, 6, [0]], [6, 11, [0]], [11, 20, [1]]])
    config = made.config
    # lanes of 4: events change words 0 and 1, spikes words 0 to 2, 2 to 4, and none
    assert config.groups == 2
    assert [tuple(span) for span in config.spans] == [(0, 3), (2, 3), (0, 0)]
    assert config.recurrent_words == 6 * 3 + 5 * 3
    assert config.delay_bins == 2
    again = network_from_images(config, weight_image(made), neuron_image(made))
    for name in (*ARRAYS, *PARAMETERS):
        assert np.array_equal(getattr(again, name), getattr(made, name)), name
    assert work_clocks(config, 1, 1) - work_clocks(config, 0, 0) == 11 * 2 + 9 * 2
    with pytest.raises(InputError, match=r"^w_rec has a weight between groups that are not connected$"):
        dataclasses.replace(made, w_rec=made.w_rec * 0 + 1)


def test_arrays_that_do_not_fit_are_refused() -> None:
    own = network()
    for rows in (5, 7):
        with pytest.raises(InputError, match=rf"w_in has the shape \({rows}, 20\), but the network needs \(6, 20\)"):
            IntegerNetwork(own.config, np.zeros((rows, 20), np.int64), own.w_rec, own.w_out, own.b_hidden, own.b_out)
    with pytest.raises(InputError, match="the network has 6 input channels, but the scans have 7"):
        own.run_counts(np.zeros((2, 3, 7), np.int64))


def test_without_floor_and_leak_there_are_no_ends() -> None:
    assert network(floor=None).hidden_ends is None
    assert network(floor=None).config.saturates
    assert ends(-5, 7, 10, -3, "zero", Leak(0)) == (-8, 17)
    assert ends(-5, 7, None, None, "zero", Leak(2)) == (-20, 31)
    assert ends(-5, 7, None, None, "zero", Leak(2, 3)) == (-7, 10)


@pytest.mark.parametrize("fields", [*VARIANTS, {"membrane_bits": 10, "output_bits": 9, "evidence_bits": 4}])
def test_counts_give_what_events_in_rising_order_give(fields: dict[str, Any]) -> None:
    own = network(1, **fields)
    counts = np.random.default_rng(2).poisson(1.0, (5, 12, own.config.inputs))
    evidence, rate = own.run_counts(counts)
    fired = 0
    for scan, expected in zip(counts, evidence, strict=True):
        state = State(own)
        for row in scan:
            state.add_events(np.repeat(np.arange(own.config.inputs), row))
            fired += int(state.end_single_bin().spikes.sum())
        assert np.array_equal(state.evidence[0], expected)
    assert fired > 100
    assert rate == fired / (5 * 12 * own.config.hidden)


def test_an_event_takes_as_many_clocks_as_a_row_has_words() -> None:
    own = network()
    ready = first_ready(own.config, -1)
    run = simulate(own, [(0, 1)] * 9, [ready + 12, 2000], 4000)
    assert ready == own.config.hidden + own.config.classes + 2
    assert run.accepted[:3] == [ready, ready + 5, ready + 10]
    assert run.accepted[3] == run.valid[0] - 1  # event_ready one clock before class_valid
    assert run.stalled == sum(run.accepted) - sum([0, *(clock + 1 for clock in run.accepted[:-1])])
    assert len(run.bins) == 2
    assert not run.overruns


def test_a_spike_takes_its_share_of_the_work() -> None:
    config = network().config
    assert work_clocks(config, 0, 0) == 20 + 20 + 2 + 20 + 3
    some, more = (np.arange(20) < count for count in (3, 7))
    assert work_clocks(config, some, more) == (20 + 3 * 4) + 20 + 2 + (20 + 7 * 2) + 3


def test_every_event_goes_to_its_channel_and_none_is_taken_behind_the_end() -> None:
    own = network()
    ready = first_ready(own.config, -1)
    channels = [0, 3, 5, 3, 1, 2]
    run = simulate(own, [(0, channel) for channel in channels], [ready + 100], 4000)
    plain = State(own)
    plain.add_events(channels)
    expected = plain.end_single_bin()
    for found, wanted in zip(run.bins[0], expected, strict=True):
        assert np.array_equal(found, wanted)
    for first, taken in ((ready + 9, [ready + 9]), (ready + 10, [])):
        assert simulate(own, [(first, 0)], [], ready + 10).accepted == taken


def test_a_bin_within_the_work_of_another_is_an_overrun_and_one_of_them_is_kept() -> None:
    own = network()
    ready = first_ready(own.config, -1)
    run = simulate(own, [], [ready + 5, ready + 20, ready + 30], 4000)
    assert run.overruns == [ready + 20, ready + 30]
    assert run.ended == [ready + 5, ready + 20]
    assert run.latencies[1] > run.latencies[0] > 3 * own.config.hidden


def test_file_holds_the_network_and_gives_equal_bytes(tmp_path: Path) -> None:
    own = IntegerWeights(network(), ("a", "b", "c"), {"unit": 0.5})
    own.save(tmp_path / "one.npz")
    read = IntegerWeights.load(tmp_path / "one.npz")
    read.save(tmp_path / "two.npz")
    assert (tmp_path / "one.npz").read_bytes() == (tmp_path / "two.npz").read_bytes()
    assert read.class_names == own.class_names
    assert read.network.config == own.network.config
    assert np.array_equal(read.network.w_rec, own.network.w_rec)


def test_images_hold_every_weight_at_its_address(tmp_path: Path) -> None:
    own = network(4, in_bits=5, rec_bits=3)
    config = own.config
    words, neurons = weight_image(own), neuron_image(own)
    rows = [*own.w_rec, *own.w_in]
    for row, weights in enumerate(rows):
        for neuron, weight in enumerate(weights):
            word = words[row << config.row_bits | neuron // config.lanes]
            got = word >> neuron % config.lanes * config.weight_bits & 31
            assert got - (got >> 4 << 5) == weight
    assert [neurons[n << config.neuron_row_bits | 3] & 511 for n in range(20)] == [b & 511 for b in own.b_hidden]
    assert [neurons[n << config.neuron_row_bits | 4] & 511 for n in range(3)] == [b & 511 for b in own.b_out]
    assert not any(neurons[n << config.neuron_row_bits | 4] for n in range(3, 20))  # no output, no bias of one
    paths = write_images(own, tmp_path, "net")
    assert [path.name for path in paths] == ["net.weights.hex", "net.neurons.hex"]
    assert [int(line, 16) for line in paths[0].read_text().split()] == words
    assert {len(line) for line in paths[1].read_text().split()} == {3}


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"lanes": 12}, "lanes must be a power of two, not 12"),
        ({"lanes": 5}, "lanes must be a power of two, not 5"),
        ({"in_bits": 9}, "in_bits must be in 2..8, not 9"),
        ({"floor": 3}, "floor must be in -8388608..0 or none, not 3"),
        ({"threshold": 2**23}, "threshold must be in 1..8388607"),
        ({"readout": "rate"}, "readout must be one of spikes, membrane, not 'rate'"),
        ({"hidden": 2.5}, "hidden must be of type int, not 2.5"),
        ({"out_shift": 17}, "out_shift must be in 0..16, not 17"),
        ({"own_parameters": True, "leak_shift": 8}, r"leak must be a shift of at most 7, not 1 / 2\*\*8"),
        ({"layers": [[0, 256]]}, "layers must list start, end and groups read of each group, not"),
        ({"layers": [[0, 9, []], [8, 256, [0]]]}, "group 1 must start at 9 and end behind it, not at (8, 256"),
        ({"layers": [[0, 9, []], [9, 20, [0]]]}, "the groups end at 20, but the network has 256 hidden neurons"),
        ({"layers": [[0, 9, [2]], [9, 256, [0]]]}, "group 0 must read groups of 0..1, rising, not (2,"),
        ({"layers": [[0, 9, []], [9, 256, [1]]]}, "group 1 must read group 0, not only (1,"),
        ({"layers": [[0, 256, []]]}, "a network of one group reads itself; leave its layers out"),
        (
            {"layers": [[0, 9, []], [9, 20, [0]], [20, 30, [1]], [30, 256, [0, 2]]]},
            "the groups that read group 0 must be neighbours, not [1, 3]".replace("[", r"\["),
        ),
        ({"neuron_reset": "delayed", "synapse_shift": 1}, "a delayed reset needs neurons without a synaptic current"),
        ({"margin": 2**24}, r"margin must be below 2\*\*24, the range of the evidence, not 16777216"),
        ({"margin": 1, "classes": 1}, "an early decision needs two classes; leave margin out"),
        ({"bin_s": 0}, "bin_s must be a positive number of seconds, not 0"),
        ({"shade": 2, "colour": 1}, "unknown classifier field 'colour'"),
    ],
)
def test_configurations_without_hardware_are_refused_in_one_sentence(fields: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said.replace("(", r"\(")):
        ClassifierConfig.from_dict(fields)


def test_damaged_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "integer.npz"
    with pytest.raises(InputError, match="does not exist; make one"):
        IntegerWeights.load(path)
    IntegerWeights(network(), ("a", "b", "c")).save(path)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match="damaged or not an integer network"):
        IntegerWeights.load(path)
    np.savez(path, w_in=np.zeros(3))
    with pytest.raises(InputError, match="an archive, but not an integer network"):
        IntegerWeights.load(path)
    arrays = {name: getattr(network(), name) for name in ARRAYS}
    with pytest.raises(InputError, match=r"w_in must be in -2\.\.1, 2 bits, not -?\d"):
        IntegerNetwork(network().config.replace(in_bits=2), **arrays)
