"""Measure CPU time of a training step of the spiking network, compared with other libraries.

``python benchmarks/network.py --json benchmarks/results/network.json``

All candidates train the same 128-256-6 network of integrate-and-fire neurons (reset to zero, no leak, no floor, no
biases, fast-sigmoid surrogate: what all libraries have) on the same input, batch 32; a step is forward, backward and
Adam. The weights are multiples of 2**-10, so that all sums are exact and all candidates must give the very same
spikes; their gradients must agree with the plain loop (exit code 1 otherwise). Libraries that
are not installed are left out.

The limit is the time of the dense products of such a step alone: one per step and direction with the recurrent
weights, all others as one product for the whole sequence. Work over events does less than that, so the limit can be
beaten. In every round all candidates run once, one after the other; times are CPU time of the process.
"""

import statistics
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated, Any

import torch
import typer
from measure import JsonFile, timed, versions, write
from torch import Tensor, nn
from torch.nn import functional

from eskin.snn.kernels import cpu as kernel
from eskin.snn.kernels.layer import layer
from eskin.snn.kernels.reference import layer_reference
from eskin.snn.kernels.rule import NeuronRule

INPUTS, HIDDEN, CLASSES = 128, 256, 6
RULE = NeuronRule(floor=-float("inf"), surrogate="fast-sigmoid", surrogate_scale=1.0, surrogate_width=1.0)
PAPER = NeuronRule()

Forward = Callable[[Tensor, Tensor, Tensor, Tensor], tuple[Tensor, Tensor]]
"""Function of input (steps, batch, inputs) and weights w_in, w_rec, w_out that returns hidden and output spikes."""


class Spike(torch.autograd.Function):
    """Step function at 0 with surrogate derivative 1 / (1 + |x|)**2, for other libraries."""

    @staticmethod
    def forward(ctx: Any, x: Tensor) -> Tensor:  # type: ignore[override]
        ctx.save_for_backward(x)
        return (x > 0).to(x)

    @staticmethod
    def backward(ctx: Any, grad: Tensor) -> Tensor:  # type: ignore[override]
        (x,) = ctx.saved_tensors
        return grad / (1.0 + x.abs()).square()


class SpikeModule(nn.Module):
    """The step function as a torch module."""

    def forward(self, x: Tensor) -> Tensor:
        """Return the spikes for potentials minus threshold, any shape."""
        return Spike.apply(x)


def ours(rule: NeuronRule, function: Callable[..., Tensor], **options: Any) -> Forward:
    """Return two layers of this project with a given implementation."""
    zeros, ones = torch.zeros(HIDDEN), torch.ones(HIDDEN)

    def forward(x: Tensor, w_in: Tensor, w_rec: Tensor, w_out: Tensor) -> tuple[Tensor, Tensor]:
        s = function(rule, x, w_in, zeros, ones, w_rec, **options)
        return s, function(rule, s, w_out, zeros[:CLASSES], ones[:CLASSES], **options)

    return forward


def norse() -> Forward:
    """Return recurrent and feed-forward integrate-and-fire steps of Norse."""
    from norse.torch.functional import iaf

    p = iaf.IAFParameters(method="super", alpha=torch.tensor(1.0))

    def forward(x: Tensor, w_in: Tensor, w_rec: Tensor, w_out: Tensor) -> tuple[Tensor, Tensor]:
        zeros = torch.zeros(x.shape[1], HIDDEN)
        state = iaf.IAFState(zeros, zeros)
        out_state = iaf.IAFFeedForwardState(torch.zeros(x.shape[1], CLASSES))
        spikes, outputs = [], []
        for now in x.unbind():
            s, state = iaf.iaf_step(now, state, w_in, w_rec, p)
            o, out_state = iaf.iaf_feed_forward_step(functional.linear(s, w_out), out_state, p)
            spikes.append(s)
            outputs.append(o)
        return torch.stack(spikes), torch.stack(outputs)

    return forward


def spikingjelly(container: bool) -> Forward:
    """Return the integrate-and-fire node of SpikingJelly, in a loop or in its recurrent container."""
    from spikingjelly.activation_based import functional as sj
    from spikingjelly.activation_based import layer as sj_layer
    from spikingjelly.activation_based import neuron

    def node() -> nn.Module:
        return neuron.IFNode(1.0, 0.0, SpikeModule(), detach_reset=False)

    hidden, out = node(), node()
    around = sj_layer.LinearRecurrentContainer(hidden, HIDDEN, HIDDEN, bias=False) if container else hidden
    eye = torch.eye(HIDDEN)

    def forward(x: Tensor, w_in: Tensor, w_rec: Tensor, w_out: Tensor) -> tuple[Tensor, Tensor]:
        sj.reset_net(around)
        sj.reset_net(out)
        if container:
            del around.rc.weight  # the container's own linear map, of input and last spikes side by side
            around.rc.weight = torch.cat([eye, w_rec], 1)
        spikes, outputs = [], []
        for current in functional.linear(x, w_in).unbind():
            if not container and spikes:
                current = current + functional.linear(spikes[-1], w_rec)
            spikes.append(around(current))
            outputs.append(out(functional.linear(spikes[-1], w_out)))
        return torch.stack(spikes), torch.stack(outputs)

    return forward


def snntorch() -> Forward:
    """Return recurrent and plain neurons of snnTorch without leak."""
    import snntorch as snn_torch

    options = {"threshold": 1.0, "spike_grad": Spike.apply, "reset_mechanism": "zero", "reset_delay": False}
    hidden = snn_torch.RLeaky(1.0, linear_features=HIDDEN, **options)
    out = snn_torch.Leaky(1.0, **options)
    hidden.recurrent.bias = None

    def forward(x: Tensor, w_in: Tensor, w_rec: Tensor, w_out: Tensor) -> tuple[Tensor, Tensor]:
        del hidden.recurrent.weight
        hidden.recurrent.weight = w_rec
        s, mem = torch.zeros(x.shape[1], HIDDEN), torch.zeros(x.shape[1], HIDDEN)
        out_mem = torch.zeros(x.shape[1], CLASSES)
        spikes, outputs = [], []
        for current in functional.linear(x, w_in).unbind():
            s, mem = hidden(current, s, mem)
            o, out_mem = out(functional.linear(s, w_out), out_mem)
            spikes.append(s)
            outputs.append(o)
        return torch.stack(spikes), torch.stack(outputs)

    return forward


CANDIDATES: dict[str, tuple[Callable[[], Forward], NeuronRule, bool]] = {
    "this project, kernel": (lambda: ours(RULE, layer, backend="kernel"), RULE, False),
    "this project, torch": (lambda: ours(RULE, layer, backend="torch"), RULE, False),
    "plain torch loop": (lambda: ours(RULE, layer_reference), RULE, True),
    "Norse": (norse, RULE, True),
    "SpikingJelly, loop": (lambda: spikingjelly(False), RULE, True),
    "SpikingJelly, container": (lambda: spikingjelly(True), RULE, True),
    "snnTorch": (snntorch, RULE, True),
    "paper's neuron, kernel": (lambda: ours(PAPER, layer, backend="kernel"), PAPER, False),
    "paper's neuron, plain torch loop": (lambda: ours(PAPER, layer_reference), PAPER, False),
}
"""Each candidate by name: its constructor, the rule that it must equal, and whether the kernel must be faster."""


@dataclass
class Step:
    """A network in training."""

    forward: Forward
    x: Tensor  # shape (steps, batch, inputs)
    labels: Tensor  # shape (batch,)
    seconds: list[float] = field(default_factory=list)  # CPU time of every round
    weights: list[nn.Parameter] = field(init=False)

    def __post_init__(self) -> None:
        self.weights = [nn.Parameter(weight) for weight in make_weights()]
        self.adam = torch.optim.Adam(self.weights, lr=1e-3)

    def gradients(self) -> tuple[list[int], list[Tensor]]:
        """Return spike counts and gradients before the first training step."""
        s, o = self.forward(self.x, *self.weights)
        gradients = torch.autograd.grad(functional.cross_entropy(o.sum(0), self.labels), self.weights)
        return [int(s.detach().sum()), int(o.detach().sum())], list(gradients)

    def run(self) -> None:
        """Run one training step: forward, backward and Adam."""
        _, o = self.forward(self.x, *self.weights)
        loss = functional.cross_entropy(o.sum(0), self.labels)
        self.adam.zero_grad()
        loss.backward()
        self.adam.step()

    def restart(self) -> None:
        """Set the weights to their initial values."""
        with torch.no_grad():
            for weight, first in zip(self.weights, make_weights(), strict=True):
                weight.copy_(first)


def make_weights() -> list[Tensor]:
    """Return w_in, w_rec and w_out in multiples of 2**-10."""
    generator = torch.Generator().manual_seed(0)
    w_in = torch.randn(HIDDEN, INPUTS, generator=generator) * 0.08
    w_rec = nn.init.orthogonal_(torch.empty(HIDDEN, HIDDEN), generator=generator)
    w_out = torch.randn(CLASSES, HIDDEN, generator=generator) * 0.1
    return [torch.round(weight * 1024) / 1024 for weight in (w_in, w_rec, w_out)]


def make_input(steps: int, batch: int, rate: float) -> tuple[Tensor, Tensor]:
    """Return Poisson-distributed event counts, and labels."""
    generator = torch.Generator().manual_seed(1)
    x = torch.poisson(torch.full((steps, batch, INPUTS), rate), generator=generator)
    return x, torch.arange(batch) % CLASSES


def product_limit(steps: int, batch: int) -> Callable[[], None]:
    """Return a function that computes only the dense products of one training step."""
    generator = torch.Generator().manual_seed(2)

    def random(*shape: int) -> Tensor:
        return torch.randn(shape, generator=generator)

    rows = steps * batch
    x, s, g, g_out = random(rows, INPUTS), random(rows, HIDDEN), random(rows, HIDDEN), random(rows, CLASSES)
    w_in, w_rec, w_out = random(INPUTS, HIDDEN), random(HIDDEN, HIDDEN), random(HIDDEN, CLASSES)
    one, wide = torch.empty(batch, HIDDEN), torch.empty(rows, HIDDEN)
    parts = s.view(steps, batch, HIDDEN).unbind()

    def products() -> None:
        torch.mm(x, w_in, out=wide)
        for part in parts:  # forward, then backward
            torch.mm(part, w_rec, out=one)
        torch.mm(s, w_out)
        torch.mm(g_out, w_out.t(), out=wide)
        for part in parts:
            torch.mm(part, w_rec.t(), out=one)
        torch.mm(s.t(), g)
        torch.mm(x.t(), g)
        torch.mm(s.t(), g_out)

    return products


def measure(steps: int, batch: int, rate: float, rounds: int) -> dict[str, Any]:
    """Return the results of all installed candidates for one sequence length."""
    x, labels = make_input(steps, batch, rate)
    made: dict[str, Step] = {}
    for name, (make, _, _) in CANDIDATES.items():
        try:
            made[name] = Step(make(), x, labels)
        except ImportError:
            print(f"{name} is not installed and left out")
    references = {id(rule): Step(ours(rule, layer_reference), x, labels).gradients() for rule in (RULE, PAPER)}
    results: dict[str, dict[str, Any]] = {}
    for name, step in made.items():
        spikes, gradients = step.gradients()
        expected_spikes, expected = references[id(CANDIDATES[name][1])]
        errors = [float((a - b).norm() / b.norm()) for a, b in zip(gradients, expected, strict=True)]
        equal = spikes == expected_spikes and max(errors) < 1e-3 and spikes[0] > 0
        results[name] = {"spikes": spikes, "gradient_errors": errors, "equal": equal, "library": CANDIDATES[name][2]}
        for _ in range(2):
            step.run()
    products, limit = product_limit(steps, batch), []
    products()
    for _ in range(rounds):
        for step in made.values():
            step.restart()
            step.seconds.append(timed(step.run)[1])
        limit.append(timed(products)[1])
    for name, step in made.items():
        ratios = [a / b for a, b in zip(step.seconds, limit, strict=True)]
        results[name] |= {
            "cpu_s": {"median": statistics.median(step.seconds), "least": min(step.seconds), "all": step.seconds},
            "times_the_limit": statistics.median(ratios),
        }
    return {
        "steps": steps,
        "input_density": float((x != 0).float().mean()),
        "spikes_per_step": results["plain torch loop"]["spikes"][0] / (steps * batch * HIDDEN),
        "limit_cpu_s": {"median": statistics.median(limit), "least": min(limit), "all": limit},
        "candidates": results,
    }


def print_table(report: dict[str, Any]) -> None:
    """Print the results for one sequence length."""
    print(
        f"{report['steps']} steps, {report['input_density']:.0%} of the inputs not zero, "
        f"{report['spikes_per_step']:.1%} of the hidden neurons fire in a step"
    )
    print(f"{'':36}{'CPU ms':>10}{'x limit':>10}  equal")
    for name, found in report["candidates"].items():
        print(f"{name:36}{1e3 * found['cpu_s']['median']:10.1f}{found['times_the_limit']:10.2f}  {found['equal']}")
    print(f"{'matrix products alone':36}{1e3 * report['limit_cpu_s']['median']:10.1f}{1:10.2f}")


def main(
    json_file: JsonFile = None,
    steps: Annotated[list[int] | None, typer.Option(min=2, help="time steps, repeatable [200, 400]")] = None,
    batch: Annotated[int, typer.Option(min=1, help="sequences")] = 32,
    rate: Annotated[list[float] | None, typer.Option(help="events per input and step, repeatable [0.1, 0.5]")] = None,
    rounds: Annotated[int, typer.Option(min=1, help="how often everything is timed")] = 9,
) -> None:
    """Time a training step on one core."""
    torch.set_num_threads(1)
    if not kernel.available():
        print("The kernel cannot be compiled here: install g++.", file=sys.stderr)
        raise typer.Exit(2)
    reports = []
    for one_rate in rate or [0.1, 0.5]:
        for length in steps or [200, 400]:
            reports.append({"rate": one_rate} | measure(length, batch, one_rate, rounds))
            print_table(reports[-1])
    words = [f"--batch {batch} --rounds {rounds}"]
    words += [f"--steps {length}" for length in steps or []] + [f"--rate {one}" for one in rate or []]
    capability = {"cpu_capability": torch.backends.cpu.get_cpu_capability()}
    content = {"inputs": INPUTS, "hidden": HIDDEN, "classes": CLASSES, "batch": batch, "rounds": rounds, "threads": 1}
    content |= {"versions": versions("torch", "norse", "spikingjelly", "snntorch") | capability, "results": reports}
    write(json_file, "network", " ".join(words), content)
    if not all(found["equal"] for report in reports for found in report["candidates"].values()):
        print("Not all candidates give the same spikes and gradients.", file=sys.stderr)
        raise typer.Exit(1)


if __name__ == "__main__":
    typer.run(main)
