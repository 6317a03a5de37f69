"""Find the features of a network that other libraries lack, and the network that they run instead."""

from __future__ import annotations

import dataclasses
import math

from torch import nn

from eskin.snn.exchange.weights import config_of
from eskin.snn.network import SpikingNetwork, build
from eskin.snn.network_config import NetworkConfig


@dataclasses.dataclass(frozen=True)
class Lack:
    """A feature of a network that NIR, snnTorch and Norse lack.

    Attributes
    ----------
    name : str
        In a sentence behind "without".
    text : str
        What the network has, and what becomes of it.
    network : nn.Module
        The network without it, and without what stands before it in the list.
    """

    name: str
    text: str
    network: nn.Module


def lacks(network: nn.Module) -> list[Lack]:
    """Return the features of a spiking network that libraries lack, in the order of their removal."""
    config, found = config_of(network), []
    neurons = config.neurons
    rule = neurons.rule

    def note(name: str, text: str) -> None:
        found.append(Lack(name, text, _with(network, dataclasses.replace(config, units=neurons))))

    if rule.floor != -math.inf:
        neurons = dataclasses.replace(neurons, rule=dataclasses.replace(rule, floor=-math.inf))
        note("the floor", f"floor {rule.floor:g}: NIR, snnTorch and Norse have none, v falls below it there")
    if rule.reset != "zero":
        rule = dataclasses.replace(neurons.rule, reset="zero")
        neurons = dataclasses.replace(neurons, rule=rule)
        note("the subtraction", "reset by subtraction: NIR has reset to a value only, which is 0 in the file")
    if neurons.readout == "membrane":
        kind = "I" if neurons.output_decay == 1 and not neurons.learn_decay else "LI"
        neurons = dataclasses.replace(neurons, readout="spikes")
        note(kind, f"readout {kind}: snnTorch and Norse read no such node; instead of it LIF outputs can be counted")
    return found


def _with(network: nn.Module, config: NetworkConfig) -> nn.Module:
    """Return a network with the same weights and another configuration."""
    assert isinstance(network, SpikingNetwork)
    made = build(config, seed=0)
    made.load_state_dict(network.state_dict())
    return made.eval()
