"""Write the C header and the page of a register description."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from pathlib import Path

from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig
from eskin.model.registers import spi
from eskin.model.registers.description import (
    NAME,
    WORD_BITS,
    WORD_BYTES,
    Field,
    Register,
    compiled,
    parameters,
    registers,
    walk,
)

TEMPLATE = Path(__file__).with_name("page.md")
ACCESS = {"constant": "read", "setting": "read, write", "pulse": "write", "counter": "read"}


def c_header(config: ReadoutConfig) -> str:
    """Return the C header of a configuration's registers from PeakRDL: a struct of offsets, and field masks.

    Raises
    ------
    InputError
        If PeakRDL is not installed.
    """
    try:
        from peakrdl_cheader.exporter import CHeaderExporter
    except ImportError:
        raise InputError(
            "the C header needs the package peakrdl-cheader; install it with: "
            ".venv/bin/python -m pip install -c constraints.txt systemrdl-compiler peakrdl-cheader"
        ) from None
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{NAME}.h"
        CHeaderExporter().export(
            compiled(parameters(config)), str(path), generate_bitfields=False, reuse_typedefs=False
        )
        return path.read_text()


def page(config: ReadoutConfig) -> str:
    """Return the page on the registers of a configuration, as Markdown."""
    return _page(config, registers(config), "this page shows the registers of one configuration.")


def page_of_all(config: ReadoutConfig) -> str:
    """Return the page on all registers of all encoders."""
    given = parameters(config) | {"LEAKS": True, "CLOSES": True, "POLARITY": True, "SETTABLE": True}
    scope = "this page shows the registers of all encoders."
    return _page(config, walk(compiled(given)), scope)


def _page(config: ReadoutConfig, found: Iterable[Register], scope: str) -> str:
    """Fill the template."""
    read_share, write_share = 2 * spi.LOW_CLOCKS_TO_READ, spi.HIGH_CLOCKS + spi.LOW_CLOCKS
    return TEMPLATE.read_text().format(
        scope=scope,
        word_bytes=WORD_BYTES,
        high=spi.HIGH_CLOCKS,
        low=spi.LOW_CLOCKS,
        low_to_read=spi.LOW_CLOCKS_TO_READ,
        lead=spi.LEAD_CLOCKS,
        lag=spi.LAG_CLOCKS,
        gap=spi.GAP_CLOCKS,
        read_share=f"1/{read_share}",
        write_share=f"1/{write_share}",
        read_hz=f"{config.clock_hz / read_share / 1e3:g} kHz",
        write_hz=f"{config.clock_hz / write_share / 1e3:g} kHz",
        clock_hz=f"{config.clock_hz / 1e6:g} MHz",
        table=_table(found),
    )


def _table(found: Iterable[Register]) -> str:
    """Return the table of all fields; a register array takes one line."""
    lines = ["| address | register | bits | field | access | reset | range | |", "|" + "---|" * 8]
    arrays: dict[str, list[Register]] = {}
    for register in found:
        arrays.setdefault(register.name, []).append(register)
    for name, words in arrays.items():
        first, last = words[0], words[-1]
        address = f"0x{first.address:03X}" + (f" to 0x{last.address:03X}" if last != first else "")
        shown = f"`{name}`" + (f" [{len(words)}]" if first.index is not None else "")
        for field in reversed(first.fields):
            high = field.low + field.width - 1
            bits = f"{high}:{field.low}" if high > field.low else f"{high}"
            cells = [address, shown, bits, f"`{field.name}`", ACCESS[field.kind], f"{field.reset:#x}", _range(field)]
            lines.append(f"| {' | '.join(cells)} | {field.meaning} |")
            address = shown = ""
    return "\n".join(lines)


def _range(field: Field) -> str:
    """Return the range of writable values, empty if all values are allowed."""
    every = field.kind != "setting" or (field.least == 0 and field.most == (1 << field.width) - 1)
    return "" if every else f"{field.least} to {field.most}"


def constants(config: ReadoutConfig) -> dict[str, int]:
    """Return the constants of the C header by name, from the description: masks, positions, widths, resets."""
    found: dict[str, int] = {}
    for register in registers(config):
        place = register.name.upper() + ("X" if register.index is not None else "")
        for field in register.fields:
            name = f"{NAME.upper()}__{place}__{field.name.upper()}"
            found |= {
                f"{name}_bm": ((1 << field.width) - 1 << field.low) % (1 << WORD_BITS),
                f"{name}_bp": field.low,
                f"{name}_bw": field.width,
                f"{name}_reset": field.reset,
            }
    return found
