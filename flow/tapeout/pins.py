"""Pin assignment of a shuttle chip with 24 pins, and the readouts that fit."""

from eskin.base.errors import InputError
from eskin.flow.tapeout.shuttles import Shuttle
from eskin.model.config import ReadoutConfig
from eskin.model.links.four_phase import FourPhase
from eskin.model.links.four_phase_dual import FourPhaseDual

INPUTS = ("spi_sck", "spi_mosi", "registers_cs_n", "samples_cs_n", "aer_ack", "enable", "", "")
ASYNCHRONOUS = ("spi_sck", "spi_mosi", "registers_cs_n", "samples_cs_n")
"""Inputs without a relation to the clock, beside ``aer_ack``."""
CLOCKS_PER_BIT = 4
CLOCKS_BESIDE = 16
"""Clocks of a frame in addition to its bits, with a margin."""
FORCED = {"registers": "spi", "frontend": "digital"}
LINKS = (FourPhase.name, FourPhaseDual.name)
"""Links that the test of the folder plays."""
ADDRESS_PINS = 8


def outputs(config: ReadoutConfig) -> tuple[str, ...]:
    """Return the names of the output pins."""
    requests = [*reversed(config.protocol.requests), ""][:2]
    return ("spi_miso", "interrupt", *requests, "", "", "", "")


def addresses(config: ReadoutConfig) -> tuple[str, ...]:
    """Return the names of the bidirectional pins; pins with an empty name stay inputs."""
    return tuple(f"aer_addr[{bit}]" if bit < config.address_bits else "" for bit in range(ADDRESS_PINS))


def readout_for(config: ReadoutConfig, given: frozenset[str], shuttle: Shuttle) -> ReadoutConfig:
    """Return the readout for a shuttle, with SPI registers, four-phase link, and a sufficient clock frequency."""
    for name, value in FORCED.items():
        if name in given and getattr(config, name) != value:
            raise InputError(f"the pins of a shuttle need --{name} {value}, not {getattr(config, name)}; leave it out")
    if "link" in given and config.link not in LINKS:
        raise InputError(f"the pins of a shuttle need --link {' or '.join(LINKS)}, not {config.link}; leave it out")
    config = config.replace(**FORCED, link=config.link if config.link in LINKS else LINKS[0])
    if config.address_bits > ADDRESS_PINS:
        raise InputError(
            f"an address of {config.rows} x {config.columns} taxels has {config.address_bits} bits, but there are "
            f"{ADDRESS_PINS} pins; use fewer --rows and --columns"
        )
    needed = CLOCKS_PER_BIT * config.taxels * config.sample_bits + CLOCKS_BESIDE
    while config.clocks_per_sample < needed:
        config = config.replace(clocks_per_sample=2 * config.clocks_per_sample)
    if config.clock_hz > shuttle.fastest_hz:
        most = shuttle.fastest_hz / config.clocks_per_sample
        raise InputError(
            f"{config.sample_rate_hz:g} ticks a second need a clock of {config.clock_hz / 1e6:.1f} MHz to load "
            f"{config.taxels} samples a tick, but {shuttle.name} has {shuttle.fastest_hz / 1e6:.0f} MHz; "
            f"use --sample-rate {most:.0f} or less, or fewer taxels"
        )
    return config
