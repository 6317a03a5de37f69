"""CW-LCS: level-crossing sampling with a closing window for every taxel."""

from typing import Any

from amaranth.hdl import Module

from eskin.rtl.encoders import lcs
from eskin.rtl.encoders.encoder import Shared, Taxel
from eskin.rtl.logic import or_tree
from eskin.rtl.window import ClosingWindow


def build(m: Module, taxel: Taxel, shared: Shared, platform: Any) -> tuple[Any, Any]:
    """Add the reference, the comparators, and the window if it has more than one half-width."""
    return lcs.build(m, taxel, shared, platform, half_width if taxel.config.closes else None)


def half_width(m: Module, taxel: Taxel, shared: Shared, platform: Any) -> Any:
    """Add the window counter; return the half-width in closing steps."""
    config = taxel.config
    window = ClosingWindow(config)
    window.place(m, "window", platform)
    free = ~shared.pending | taxel.granted
    m.d.comb += [
        window.open.eq((free & shared.wants_event) | (shared.enabled & ~taxel.enable)),
        window.tick.eq(free & taxel.enable & taxel.tick),
        shared.closing.eq(taxel.tick & ~window.closed),
    ]
    if config.asks_between_ticks:
        m.d.comb += shared.narrows.eq(window.narrows)
    if config.registers == "none":
        return window.half_width
    m.d.comb += window.period.eq(taxel.window_period)
    width = window.half_width
    return or_tree([(width & on.replicate(len(width))) << s for s, on in enumerate(taxel.step)])
