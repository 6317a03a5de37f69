"""Test networks as NIR graphs: equal spikes when run from the file, and exact round trip.

``run`` is an interpreter of its own: NumPy, the equations of the NIR nodes by forward Euler, nothing of ``snn``.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import h5py  # type: ignore[import-untyped]
import nir
import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.snn.exchange.nir_events import load_nir_data
from eskin.snn.exchange.nir_network import from_nir, load_nir, save_nir, to_nir
from eskin.snn.exchange.portable import lacks
from eskin.snn.exchange.weights import Weights, load_weights, save_weights
from tests.snn.helpers import some_weights

CLASSES = ("a", "b", "c")
STEP_S = 0.002
VARIANTS: dict[str, dict[str, Any]] = {
    "paper": {},
    "tuned": {"input_scale": 0.4, "decay": 0.8, "output_decay": 0.95, "readout": "membrane", "dropout": 0.3},
    "learned": {"decay": 0.9, "output_decay": 0.8, "learn_decay": True, "output_scale": 0.1},
    "subtract": {"reset": "subtract", "decay": 0.95, "floor": -0.5},
    "no floor": {"floor": float("-inf"), "surrogate": "arctan"},
    "no leak in the membrane": {"readout": "membrane"},
}


def made(**fields: Any) -> Weights:
    """Return a firing network with random biases and decays."""
    weights = some_weights(CLASSES, STEP_S, seed=4, hidden=20, **fields)
    generator = torch.Generator().manual_seed(1)
    with torch.no_grad():
        for name, tensor in weights.network.named_parameters():
            if name.startswith(("b_", "raw_")):
                tensor.add_(torch.randn(tensor.shape, generator=generator), alpha=0.1)
            else:
                tensor.mul_(1.5)
    return weights


def scans() -> torch.Tensor:
    generator = torch.Generator().manual_seed(2)
    rates = 2 * torch.rand((1, 30, 6), generator=generator) ** 2  # each scan has channels of its own that lead
    return torch.poisson(rates.expand(60, -1, -1), generator=generator)


CHAIN = ("hidden_in", "hidden", "recurrent", "readout_in", "readout")


def run(graph: nir.NIRGraph, x: NDArray[Any], chain: Sequence[str] = CHAIN) -> list[NDArray[Any]]:
    """Return the outputs of hidden neurons and of the readout, shapes (steps, scans, neurons).

    A recurrent edge arrives one step later.
    """
    dt = graph.metadata["dt"]
    hidden_in, hidden, recurrent, readout_in, readout = (graph.nodes[name] for name in chain)
    v, w, s = 0.0, 0.0, np.zeros((x.shape[1], len(hidden_in.weight)))
    found = []
    for counts in x:
        v, s = step(hidden, v, linear(hidden_in, counts) + linear(recurrent, s), dt)
        w, out = step(readout, w, linear(readout_in, s), dt)
        found.append((s, out))
    return [np.array(values) for values in zip(*found, strict=True)]


def linear(node: nir.NIRNode, values: NDArray[Any]) -> NDArray[Any]:
    return values @ node.weight.T + getattr(node, "bias", 0.0)


def step(node: nir.NIRNode, v: Any, current: NDArray[Any], dt: float) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the potentials of neurons after a step, and their outputs."""
    if isinstance(node, nir.LIF | nir.LI):
        v = v + dt / node.tau * (node.v_leak - v + node.r * current)
    else:
        v = v + node.r * current
    if "floor" in node.metadata:
        v = np.maximum(v, node.metadata["floor"])
    if not isinstance(node, nir.LIF | nir.IF):
        return v, v
    fired = v > node.v_threshold
    after = v - node.v_threshold if node.metadata.get("reset") == "subtract" else node.v_reset
    return np.where(fired, after, v), fired.astype(float)


@pytest.mark.parametrize("name", VARIANTS)
def test_the_file_alone_gives_spikes_and_predictions_and_comes_back_bit_exact(tmp_path: Path, name: str) -> None:
    weights, path, x = made(**VARIANTS[name]), tmp_path / "net.nir", scans()
    save_nir(path, weights)
    graph = nir.read(path)
    hidden, readout = run(graph, x.numpy())
    network = weights.network.eval()
    with torch.no_grad():
        spikes, logits = network.spikes(x).numpy(), network(x).logits.numpy()
    assert 0.05 < spikes.mean() < 0.9
    np.testing.assert_array_equal(hidden, spikes)
    total = readout.sum(0) if "sum over time" in graph.metadata["logits"] else readout.mean(0)
    np.testing.assert_allclose(total * graph.metadata["output_scale"], logits, rtol=1e-4, atol=1e-4)
    np.testing.assert_array_equal(total.argmax(1), logits.argmax(1))
    assert len(set(logits.argmax(1))) > 1

    loaded = load_nir(path)
    assert loaded.network.config == network.config
    assert (loaded.class_names, loaded.step_s) == (CLASSES, STEP_S)
    for key, tensor in network.state_dict().items():
        assert torch.equal(loaded.network.state_dict()[key], tensor), key
    np.testing.assert_array_equal(loaded.network.eval()(x).logits.detach().numpy(), logits)
    first = path.read_bytes()
    save_nir(path, loaded)
    assert path.read_bytes() == first


def test_learned_decays_may_reach_their_ends(tmp_path: Path) -> None:
    weights = made(**VARIANTS["learned"])
    network = weights.network
    with torch.no_grad():
        network.raw_decay[:2] = torch.tensor([60.0, -200.0])
    assert network.decays()[0][:2].tolist() == [1.0, 0.0]
    save_nir(tmp_path / "net.nir", weights)
    loaded = load_nir(tmp_path / "net.nir")
    assert torch.equal(loaded.network.eval()(scans()).logits, weights.network.eval()(scans()).logits)


def test_the_neurons_are_those_of_the_document() -> None:
    for readout, kinds in (("spikes", [nir.IF, nir.IF]), ("membrane", [nir.IF, nir.I])):
        nodes = to_nir(made(readout=readout)).nodes
        assert [type(nodes[name]) for name in ("hidden", "readout")] == kinds
    leaky = to_nir(made(**VARIANTS["tuned"])).nodes["hidden"]
    assert (type(leaky), set(leaky.r)) == (nir.LIF, {1.0}), "other programs ignore r"


def foreign(**changes: Any) -> nir.NIRGraph:
    """Return a NIR graph in the style of another program."""
    generator = np.random.default_rng(3)
    tau, r = np.full(5, 0.01), np.full(5, 3.0)
    nodes = {
        "in": nir.Input(input_type={"input": np.array([4])}),
        "fc1": nir.Linear(weight=generator.normal(size=(5, 4))),
        "lif1": nir.LIF(tau=tau, r=r, v_leak=np.full(5, 0.3), v_threshold=np.linspace(0.5, 2, 5)),
        "rec": nir.Affine(weight=generator.normal(size=(5, 5)), bias=np.full(5, 0.05)),
        "fc2": nir.Affine(weight=generator.normal(size=(2, 5)), bias=np.full(2, 0.1)),
        "if2": nir.IF(r=np.full(2, 0.5), v_threshold=np.full(2, 0.7)),
        "out": nir.Output(output_type={"output": np.array([2])}),
    } | changes
    edges = [("in", "fc1"), ("fc1", "lif1"), ("lif1", "rec"), ("rec", "lif1")]
    edges += [("lif1", "fc2"), ("fc2", "if2"), ("if2", "out")]
    return nir.NIRGraph(nodes, edges, type_check=False)


def test_a_graph_of_another_program_is_run_as_it_says(tmp_path: Path) -> None:
    nir.write(tmp_path / "other.nir", foreign())
    with pytest.raises(InputError, match="has no time step; give it in seconds"):
        load_nir(tmp_path / "other.nir")
    loaded = load_nir(tmp_path / "other.nir", step_s=0.001, class_names=("x", "y"))
    x = torch.poisson(torch.full((80, 6, 4), 0.8), generator=torch.Generator().manual_seed(5))
    graph = foreign()
    graph.metadata["dt"] = 0.001
    hidden, output = run(graph, x.numpy(), ("fc1", "lif1", "rec", "fc2", "if2"))
    assert 0.02 < hidden.mean() < 0.9
    assert output.sum() > 20
    network = loaded.network.eval()
    np.testing.assert_array_equal(network.spikes(x).detach().numpy(), hidden)
    np.testing.assert_array_equal(network(x).logits.detach().numpy(), output.sum(0))
    assert (loaded.class_names, loaded.step_s) == (("x", "y"), 0.001)
    assert network.config.floor == float("-inf")


def test_leaks_that_differ_come_in_as_learned_ones_that_began_as_the_first() -> None:
    tau = np.array([0.01, 0.02, 0.04, 0.05, 0.1])
    lif = nir.LIF(tau=tau, r=np.full(5, 3.0), v_leak=np.zeros(5), v_threshold=np.ones(5))
    leaky = nir.LIF(tau=np.full(2, 0.02), r=np.full(2, 0.5), v_leak=np.zeros(2), v_threshold=np.ones(2))
    network = from_nir(foreign(lif1=lif, if2=leaky), step_s=0.001).network
    np.testing.assert_allclose(network.decays()[0].detach().numpy(), 1 - 0.001 / tau, rtol=1e-6)
    neurons = network.config
    assert (neurons.learn_decay, neurons.decay, neurons.output_decay) == (True, pytest.approx(0.9), pytest.approx(0.95))


def test_numbers_for_whole_layers_and_scales_of_channels_are_taken() -> None:
    scale = np.array([1.0, 2.0, 0.5, 0.0])
    graph = foreign(lif1=nir.LIF(tau=np.array(0.01), r=np.array(3.0), v_leak=np.array(0.0), v_threshold=np.array(1.0)))
    graph.nodes["scale"] = nir.Scale(scale=scale)
    graph.edges = [e for e in graph.edges if e != ("in", "fc1")] + [("in", "scale"), ("scale", "fc1")]
    network = from_nir(graph, step_s=0.001).network
    expected = graph.nodes["fc1"].weight * scale * 0.3
    np.testing.assert_allclose(network.state_dict()["w_in"].numpy(), expected, rtol=1e-6)


def lif(**changes: Any) -> nir.LIF:
    fields = {"tau": 0.01, "r": 1.0, "v_leak": 0.0, "v_threshold": 1.0, "v_reset": 0.0} | changes
    return nir.LIF(**{name: np.full(5, value) for name, value in fields.items()})


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "CubaLIF": (
        {"lif1": nir.CubaLIF(*[np.ones(5)] * 5)},
        "node 'lif1' has a synaptic current and a v_leak other than 0",
    ),
    "tau_syn": (
        {"lif1": nir.CubaLIF(np.linspace(0.01, 0.02, 5), np.ones(5), np.ones(5), np.zeros(5), np.ones(5))},
        "node 'lif1' has a tau_syn for each neuron; the network has one",
    ),
    "reset": ({"lif1": lif(v_reset=0.2)}, "node 'lif1' has a v_reset other than 0"),
    "threshold": ({"lif1": lif(v_threshold=0.0)}, "node 'lif1' has a v_threshold that is not positive"),
    "tau": ({"lif1": lif(tau=0.0005)}, "node 'lif1' has a tau that is not above 0.001 s"),
    "size": (
        {"rec": nir.Linear(weight=np.ones((4, 4)))},
        r"node 'rec' has weights of shape \(4, 4\), but node 'lif1' has 5 neurons",
    ),
    "floor": (
        {"lif1": nir.LIF(*[np.ones(5)] * 3, v_threshold=np.linspace(0.5, 2, 5), metadata={"floor": -1.0})},
        "node 'lif1' has a floor and different thresholds, but the network has one floor",
    ),
    "number": (
        {"lif1": nir.LIF(*[np.ones(5)] * 4, metadata={"floor": "low"})},
        "node 'lif1' has a floor that is not a number",
    ),
    "weights": ({"fc2": nir.Linear(weight=np.full((2, 5), np.nan))}, "node 'fc2' has weights that are not finite"),
    "no leak": (
        {"if2": nir.LIF(*[np.array([0.01, 0.02])] + [np.ones(2)] * 3), "lif1": nir.IF(np.ones(5), np.ones(5))},
        "node 'lif1' has no leak, while those of 'if2' differ; give it a long tau",
    ),
    "layer": ({"fc2": nir.Flatten(input_type={"input": np.array([5])})}, "node 'fc2' is of type Flatten"),
    "parameters": (
        {"if2": nir.IF(r=np.ones(3), v_threshold=np.ones(3))},
        r"node 'if2' has parameters of shape \(3,\), not \(2,\)",
    ),
    "beside": ({"more": nir.Linear(weight=np.ones((2, 2)))}, "node 'more' is not on the path"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_an_unsupported_nir_node_is_refused_by_name(name: str) -> None:
    changes, message = REFUSED[name]
    with pytest.raises(InputError, match=message):
        from_nir(foreign(**changes), step_s=0.001)


def test_other_forms_and_broken_files_are_refused(tmp_path: Path) -> None:
    rec = foreign().nodes["rec"]
    for nodes, edges, message in (
        ({}, [("if2", "fc2")], "the graph has 8 edges, where the network has 7; remove other loops"),
        ({}, [("in", "fc2")], "node 'in' leads to 2 further nodes; it must lead to one"),
        ({"twice": rec}, [("lif1", "twice"), ("twice", "lif1")], "node 'lif1' has 2 recurrent connections; the "),
        ({}, [("in", "nowhere")], "the graph is incomplete"),
    ):
        graph = foreign(**nodes)
        graph.edges = [*graph.edges, *edges]
        with pytest.raises(InputError, match=message):
            from_nir(graph, step_s=0.001)
    with pytest.raises(InputError, match=r"export it as \.npz"):
        to_nir(some_weights(kind="gru"))
    with pytest.raises(InputError, match=r"NIR files end in \.nir, but net\.h5 does not"):
        save_nir(tmp_path / "net.h5", made())
    with pytest.raises(InputError, match="cannot read"):
        load_nir(tmp_path / "none.nir")
    path = tmp_path / "net.nir"
    save_nir(path, made())
    path.write_bytes(path.read_bytes()[:5000])
    with pytest.raises(InputError, match="is damaged or not a NIR graph"):
        load_nir(path)


@pytest.mark.parametrize(
    ("kind", "sentence"),
    [
        ("external link", "links 'more' to another object or file; export it completely"),
        ("soft link", "links 'more' to another object or file"),
        ("external storage", "refers to another file for '/more'; export it completely"),
        ("virtual", "refers to another file for '/more'"),
        ("bomb", "claims more than 1024 MiB of data, and is refused"),
        ("circle", "has a group that contains itself"),
    ],
)
def test_a_nir_file_reads_no_other_file_and_no_more_than_it_may(tmp_path: Path, kind: str, sentence: str) -> None:
    path, secret = tmp_path / "a.nir", tmp_path / "secret"
    save_nir(path, made())
    secret.write_bytes(np.arange(100.0).tobytes())
    with h5py.File(path, "a") as file:
        if kind == "external link":
            file["more"] = h5py.ExternalLink(str(secret), "/")
        elif kind == "soft link":
            file["more"] = h5py.SoftLink("/")
        elif kind == "external storage":
            file.create_dataset("more", (100,), "f8", external=[(str(secret), 0, 800)])
        elif kind == "virtual":
            layout = h5py.VirtualLayout((100,), "f8")
            layout[:] = h5py.VirtualSource(str(secret), "a", (100,))
            file.create_virtual_dataset("more", layout)
        elif kind == "bomb":
            file.create_dataset("more", (2**28,), "f8", chunks=(2**20,), compression="gzip")
        else:
            file.create_group("more")["again"] = file["/"]
    for reader in (load_nir, load_nir_data):
        with pytest.raises(InputError) as error:
            reader(path)
        assert sentence in str(error.value)


def test_metadata_that_contradict_the_nodes_are_refused() -> None:
    graph = to_nir(made(**VARIANTS["tuned"]))
    graph.nodes["hidden"].tau = graph.nodes["hidden"].tau * 1.1
    graph.nodes["hidden"].r = graph.nodes["hidden"].r * 1.1
    with pytest.raises(InputError, match="node 'hidden' has a tau that contradicts the decay in the metadata"):
        from_nir(graph)
    graph = to_nir(made())
    for name in ("hidden", "readout"):
        graph.nodes[name].metadata["reset"] = "subtract"
    with pytest.raises(InputError, match="the nodes of the graph give reset = subtract, but its metadata give zero"):
        from_nir(graph)
    graph.nodes["readout"].metadata["reset"] = "zero"
    with pytest.raises(InputError, match="nodes 'hidden' and 'readout' differ in floor or reset"):
        from_nir(graph)
    with pytest.raises(InputError, match=r"a time step of 0\.002 s, not 0\.001 s"):
        from_nir(to_nir(made()), step_s=0.001)
    graph = to_nir(made())
    graph.nodes["hidden_in"].metadata["input_scale"] = 0.0
    with pytest.raises(InputError, match=r"hold an input_scale of 0\.0, which is not a positive number"):
        from_nir(graph)
    graph = to_nir(made())
    graph.metadata["header"] = "{"
    with pytest.raises(InputError, match="the metadata of the graph are damaged"):
        from_nir(graph)


@pytest.mark.command("export", "import")
def test_networks_go_out_and_come_back(eskin: Any, folder: Path) -> None:
    weights, x = made(), scans()
    save_weights(Path("w.npz"), weights)
    assert eskin("export w.npz -o net.nir")[0].startswith("net.nir: 3 classes, 0.002 s per step")
    assert eskin("import net.nir -o back.npz")[0] == "back.npz: 6 inputs, 20 hidden neurons, classes a, b, c\n"
    assert Path("back.npz").read_bytes() == Path("w.npz").read_bytes()
    eskin("export w.npz -o small.npz --eight-bits")
    assert Path("small.npz").stat().st_size < Path("w.npz").stat().st_size
    small = load_weights(Path("small.npz")).network.eval()(x).logits
    assert not torch.equal(small, weights.network.eval()(x).logits)
    nir.write("other.nir", foreign())
    eskin("import other.nir -o other.npz --step 0.001 --classes x,y")
    assert load_weights(Path("other.npz")).class_names == ("x", "y")


def test_an_export_says_what_other_libraries_lack(eskin: Any, folder: Path) -> None:
    save_weights(Path("w.npz"), made(**VARIANTS["tuned"], reset="subtract"))
    text, _ = eskin("export w.npz -o net.nir")
    for line in (
        "input scale 0.4: included in the weights of hidden_in",
        "floor -1: NIR, snnTorch and Norse have no floor",
        "reset by subtraction: NIR only has a reset to a value",
        "readout LI: snnTorch and Norse cannot read this node",
        "the loss of accuracy was not measured: result.json of the training is missing beside w.npz",
    ):
        assert line in text
    save_weights(Path("w.npz"), made(**VARIANTS["no floor"]))
    assert "snnTorch and Norse support every feature of this network" in eskin("export w.npz -o net.nir")[0]


def test_missing_features_of_a_library_are_removed_one_by_one() -> None:
    found = lacks(made(**VARIANTS["tuned"]).network)
    assert [lack.name for lack in found] == ["the floor", "LI"]
    state = made(**VARIANTS["tuned"]).network.state_dict()
    for lack, readout in zip(found, ("membrane", "spikes"), strict=True):
        config = lack.network.config
        assert (config.floor, config.readout) == (float("-inf"), readout)
        assert all(torch.equal(tensor, state[name]) for name, tensor in lack.network.state_dict().items())


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("export w.npz -o net.onnx", "networks end in .nir or .npz, but net.onnx does not; rename the output"),
        ("export w.npz -o net.nir --eight-bits", "NIR has no 8-bit weights; write an .npz, or leave --eight-bits out"),
        ("export none.npz -o net.nir", "weight file none.npz does not exist; make one with eskin train"),
        ("export gru.npz -o net.nir", "a network of kind gru has no NIR neurons; export it as .npz"),
        ("export w.npz -o none/net.nir", "cannot write none/net.nir: the folder none does not exist"),
        ("import w.npz -o back.npz", "w.npz is damaged or not a NIR graph; export it again"),
        ("import net.nir -o back.nir", "weight files end in .npz, but back.nir does not; rename the output"),
        ("import net.nir -o b.npz --classes a,a,b", "net.nir: class 'a' is named twice"),
        ("import net.nir -o b.npz --classes a,,b", "net.nir: class names must be a list of texts, not ['a', '', 'b']"),
        ("import net.nir -o b.npz --classes a,b", "net.nir: node 'readout' has 3 outputs, not 2; give a class name"),
        ("export slow.npz -o w.nir", "a time step of 1e+308 s gives time constants that NIR cannot store; export the"),
    ],
)
def test_wrong_commands_are_one_sentence_and_leave_nothing(refuses: Any, line: str, message: str) -> None:
    save_weights(Path("w.npz"), made())
    save_weights(Path("gru.npz"), some_weights(kind="gru"))
    save_weights(Path("slow.npz"), some_weights(step_s=1e308, decay=0.5))
    save_nir(Path("net.nir"), made())
    refuses(f"error: {message}", line)
