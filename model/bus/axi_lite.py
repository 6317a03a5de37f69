"""Times and addresses of the AXI4-Lite access to registers."""

from eskin.model.registers.description import WORD_BITS
from eskin.model.registers.spi import COMMAND_BITS

BUS_ADDRESS_BITS = 12
"""Bits of an address: a window of 4 KiB holds all registers of the largest array."""

CLOCKS_PER_BIT = 8
"""Clocks of the readout per bit of the SPI transfer: SCK is low for four, then high for four."""

OKAY, SLVERR = 0b00, 0b10
"""Responses: SLVERR only for a write without all byte strobes."""

ACCESS_CLOCKS = 2 + CLOCKS_PER_BIT * (COMMAND_BITS + WORD_BITS)
"""Clocks from the valid signals of an access to its response, with no other access under way."""
