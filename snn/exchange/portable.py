"""Find features of a network that other libraries lack, and the closest network that they can run."""

import dataclasses
import math
from typing import Any

from torch import nn

from eskin.snn.exchange.weights import config_of
from eskin.snn.network import build


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

    def without(name: str, text: str, **changes: Any) -> None:
        nonlocal config
        config = dataclasses.replace(config, **changes)
        made = build(config, seed=0)
        made.load_state_dict(network.state_dict())
        found.append(Lack(name, text, made.eval()))

    if config.floor != -math.inf:
        text = f"floor {config.floor:g}: NIR, snnTorch and Norse have no floor, so the potential v can fall lower"
        without("the floor", text, floor=-math.inf)
    if config.reset != "zero":
        text = "reset by subtraction: NIR only has a reset to a value, which is 0 in the file"
        without("the subtraction", text, reset="zero")
    if config.readout == "membrane":
        kind = "I" if config.output_decay == 1 and not config.learn_decay else "LI"
        text = f"readout {kind}: snnTorch and Norse cannot read this node; count LIF outputs instead"
        without(kind, text, readout="spikes")
    return found
