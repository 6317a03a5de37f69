"""Find features of a network that other libraries lack, and the closest network that they can run."""

from __future__ import annotations

import dataclasses
import math

from torch import nn

from eskin.snn.exchange.weights import config_of
from eskin.snn.network import SpikingNetwork, build
from eskin.snn.network_config import NetworkConfig


@dataclasses.dataclass(frozen=True)
class Lack:
    """A network feature that NIR, snnTorch and Norse lack."""

    name: str
    """Text for a sentence after "without"."""
    text: str
    """Feature of the network, and its replacement."""
    network: nn.Module
    """Network without this feature and without all earlier features in the list."""


def lacks(network: nn.Module) -> list[Lack]:
    """Return the features of a spiking network that other libraries lack, in order of removal."""
    config, found = config_of(network), []
    neurons = config.neurons
    rule = neurons.rule

    def note(name: str, text: str) -> None:
        found.append(Lack(name, text, _with(network, dataclasses.replace(config, units=neurons))))

    if rule.floor != -math.inf:
        neurons = dataclasses.replace(neurons, rule=dataclasses.replace(rule, floor=-math.inf))
        note(
            "the floor",
            f"floor {rule.floor:g}: NIR, snnTorch and Norse have no floor, so the potential v can fall lower",
        )
    if rule.reset != "zero":
        rule = dataclasses.replace(neurons.rule, reset="zero")
        neurons = dataclasses.replace(neurons, rule=rule)
        note("the subtraction", "reset by subtraction: NIR only has a reset to a value, which is 0 in the file")
    if neurons.readout == "membrane":
        kind = "I" if neurons.output_decay == 1 and not neurons.learn_decay else "LI"
        neurons = dataclasses.replace(neurons, readout="spikes")
        note(kind, f"readout {kind}: snnTorch and Norse cannot read this node; count LIF outputs instead")
    return found


def _with(network: nn.Module, config: NetworkConfig) -> nn.Module:
    """Return a network with equal weights and another configuration."""
    assert isinstance(network, SpikingNetwork)
    made = build(config, seed=0)
    made.load_state_dict(network.state_dict())
    return made.eval()
