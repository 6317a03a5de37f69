"""Write the functional points of a design: cover statements in SystemVerilog for its modules, from the files here."""

import itertools
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import jinja2

from eskin.board.config import BoardConfig
from eskin.board.records import Reason
from eskin.board.serial_frames import MAX_PAYLOAD
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.config import ClassifierConfig, highest, lowest
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import FrameConfig
from eskin.model.frame_words import bit_positions
from eskin.model.registers.description import Register, registers
from eskin.model.tiles.config import MergeConfig, TilesConfig
from eskin.rtl.verilog import Config

MACROS = """`define COVER(name, expression) point_``name: cover property (@(posedge clk) expression);
`define RESETS(name, state) point_reset_``name: cover property (@(posedge clk) rst && !$past(rst) && $past(state));
"""
"""A point is reached at a rising edge at which its expression holds, or in the first clock of a reset that interrupts
a state."""

BOARD = ("uart_receiver", "frames", "core", "core_recorder", "core_sender")


def each(text: str, count: int, step: int = 1) -> list[str]:
    """Return a text with each of the first numbers in it."""
    return [text.format(number * step) for number in range(count)]


def every(names: Iterable[str], text: str) -> str:
    """Return an expression that is true if a text holds with every name in it."""
    return " && ".join(text.format(name) for name in names)


def any_of(names: Iterable[str], text: str = "{}") -> str:
    """Return an expression that is true if a text holds with any name in it."""
    return "(" + " || ".join(f"({text.format(name)})" for name in names) + ")"


def plain(register: Register) -> str:
    """Return the name of a register in the Verilog."""
    return register.name if register.index is None else f"{register.name}_{register.index}"


FILES = jinja2.Environment(
    loader=jinja2.FileSystemLoader(Path(__file__).parent),
    trim_blocks=True,
    keep_trailing_newline=True,
    undefined=jinja2.StrictUndefined,
)
FILES.globals |= {"each": each, "every": every, "any_of": any_of, "plain": plain, "highest": highest, "lowest": lowest}


def points(config: Config | BoardConfig) -> dict[str, str]:
    """Return the points of a configuration by module, as text in front of ``endmodule``."""
    return {f"eskin_{module}": FILES.get_template(f"{file}.sv").render(own) for module, file, own in _files(config)}


def _files(config: Config | BoardConfig) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Yield modules, and their files of points with values."""
    own: dict[str, Any] = {"config": config}
    if isinstance(config, BoardConfig):
        own |= {"longest": MAX_PAYLOAD + 7, "words": MAX_PAYLOAD // 4, "records": config.serial.records}
        own |= {reason.name.lower(): int(reason) for reason in Reason}
        yield from ((f"board_{part}", f"board_{part}", own) for part in BOARD)
    elif isinstance(config, MergeConfig):
        yield "merge", "merge", {"config": config.skin, "tiles": config.skin.tiles}
    elif isinstance(config, TilesConfig):  # a readout too, of tiles
        yield "merge", "merge", own | {"tiles": config.tiles}
        if config.relays:
            yield from (("relay", "relay", own), ("tiles", "tiles", own))
    elif isinstance(config, ReadoutConfig):
        own["some"] = lambda text: some(config, text)
        if config.registers == "spi":
            listed = registers(config)
            yield "registers", "registers", own | {"registers": listed, "plains": list(map(plain, listed))}
            yield from (("pattern", "pattern", own), ("spi", "spi", own), ("readout", "host", own))
        else:
            sizes = {"step_bits": (config.step - 1).bit_length(), "grid_bits": (config.grid - 1).bit_length()}
            taxels = [f"row_{row}.taxel_{column}" for row in range(config.rows) for column in range(config.columns)]
            yield "readout", "readout", own | sizes | {"taxels": taxels}
    elif isinstance(config, FrameConfig):
        yield "frame_readout", "frame", own | {"bits": config.resolution, "words": _words(config)}
    elif isinstance(config, ClassifierConfig):
        potentials = [("hidden", config.membrane_bits, config.floor, config.saturates)]
        if config.readout == "spikes":
            potentials += [("output", config.output_bits, config.out_floor, config.output_saturates)]
        yield "classifier", "classifier", own | {"classifier": config, "potentials": potentials}
    elif isinstance(config, ChipConfig):
        yield "chip", "chip", own


def some(config: ReadoutConfig, expression: str) -> str:
    """Return an expression that is true if a given expression is true for any taxel ``T`` in ``ROW`` and ``COLUMN``."""
    places = [(str(row), str(column)) for row in range(config.rows) for column in range(config.columns)]
    return any_of(
        expression.replace("T.", f"row_{row}.taxel_{column}.").replace("ROW", row).replace("COLUMN", column)
        for row, column in places
    )


def _words(config: FrameConfig) -> dict[str, Any]:
    """Return where codes stand in the words of a frame."""
    bits, size = config.resolution, config.word_bits
    padded = config.taxels * bits % size != 0
    filled = [number * bits // size for number in range(config.taxels + 1)]
    ends = [after > before for before, after in itertools.pairwise(filled)] + [True] * padded  # whether a word ends
    places = sorted({number * bits % size for number in range(config.taxels)})
    return {
        "places": places,
        "grain": bit_positions(config),
        "cut": any(size - place < bits for place in places),
        "padded": padded,
        "follow": any(this and following for this, following in zip(ends, [*ends[1:], ends[0]], strict=True)),
        "waits": padded and all(ends[-2:]),
    }
