"""The commands play, listen, load and rescue for a board on a serial line (docs/guide/board.md)."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from eskin.app.cli import echo
from eskin.app.commands import common
from eskin.app.commands.signals.recordings import OwnData, warn
from eskin.app.options import arg, command, opt, out_file, with_config
from eskin.base.errors import InputError
from eskin.base.progress import watched
from eskin.model.config import ReadoutConfig

if TYPE_CHECKING:
    from eskin.board.link import Link
    from eskin.board.live import View
    from eskin.board.session import Received
    from eskin.board.udp import UdpSender

BAUD = 2_000_000
Port = Annotated[str, opt(..., "serial port of the board, such as /dev/ttyUSB0")]
Baud = Annotated[int, opt(..., "bits per second of the board", min=1)]
Page = Annotated[int | None, opt(..., "PORT", "also serve a live page at this port of this machine")]
Udp = Annotated[
    str | None,
    opt(..., "HOST:PORT", "also send every event to this address, in jAER's UDP format; faery://HOST:PORT: in faery's"),
]
Patience = Annotated[float, opt(..., "SECONDS", "seconds of silence after which the board counts as lost", min=0.1)]
Network = Annotated[Path, arg(..., "INTEGER.npz", "integer network, from eskin quantise")]
WINDOW_S = 3.0  # seconds in the raster of a foreign chip


@command(
    "Board",
    needs="board",
    fuzz="good/nothing.npz --port good/nothing -o new.npz",
    idle={
        "--samples": "--only",
        "--sensor": "--only --raw --check",
    },
)
def play(
    weights: Network,
    port: Port,
    samples: Path | None = opt(None, "FILE", "codes of all taxels (.npy, .npz, .csv)"),
    data: OwnData = None,
    dataset: str | None = opt(None, "texture folder, or 'embedded' [embedded]"),
    only: str | None = opt(None, "texture or recording, by name"),
    sensor: bool = opt(False, "--sensor", "read the skin at the board; see fpga --adc"),
    limit: int | None = opt(None, "number of sample ticks [all; a skin: until Ctrl-C]", min=1),
    check: bool = opt(True, "compare events and classes with the model"),
    page: Page = None,
    udp: Udp = None,
    raw: bool = opt(False, "--raw", "send all samples in 16 bits and take events in 32, as an earlier board needs"),
    baud: Baud = BAUD,
    patience: Patience = 3.0,
    out: Path = out_file(Path("out/played.npz"), "file for the events"),
) -> None:
    """Play a texture, a recording or a file of codes through the readout and classifier of a board.

    The weights are loaded first. Exit code 1 if board and model differ.
    """
    from eskin.board import session
    from eskin.board.config import BoardConfig
    from eskin.board.demo import piece_of
    from eskin.board.link import Link
    from eskin.board.live import View
    from eskin.board.stimulus import codes_to_play
    from eskin.model.classifier.file import IntegerWeights

    if sum(bool(one) for one in (samples, data, dataset, sensor)) > 1:
        raise InputError("--samples, --data, --dataset and --sensor each choose an input; give one of them")
    network = IntegerWeights.load(weights)
    chip = session.chip_of(network, weights)
    view = View(chip.readout, chip.clock_hz, WINDOW_S, network.class_names, chip.classifier.clocks_per_bin)
    if sensor:
        name, codes = "the skin", None
    else:
        name, codes = codes_to_play(network, chip.readout, samples=samples, recordings=data, dataset=dataset, only=only)
        codes = codes[:limit]
        piece = piece_of(name, codes, chip.readout)
        view.begin(piece, piece.seconds)
    received = session.Received(session.player_events(chip))
    with Link(port, received, baud, patience) as link:
        link.hello("player", BoardConfig(chip=chip))
        with (
            session.recording(out, chip.readout, {"name": name, "board": port}, received),
            _shown(view, page, udp, received, link),
        ):
            session.load(link, network)
            if codes is None:
                received.observed = session.sense(link, chip, limit)
            else:
                received.observed = session.play(link, chip, codes, whole=raw)
    found = (
        network.class_names[received.classes[-1].winner]
        if received.classes
        else "no class, because no bin was complete"
    )
    early = dict(zip(("early", "early_s"), view.early or (None, None), strict=True)) if chip.classifier.margin else {}
    events = f"{len(received.events)} events, {len(received.classes)} bins"
    echo(f"{name}: {found}{common.early_text(early)}; {events}; {out}")
    if codes is None:
        if late := received.counts.get("lost", 0):
            common.fail(f"LATE {late} scans: the serial line was too slow for the events")
        return
    if check and (difference := session.difference(chip, network, codes, received)) is not None:
        common.fail(f"{difference}\nMISMATCH")
    print("events and classes equal the model's" if check else "not compared with the model")


@command("Board", needs="board", fuzz="--port good/nothing -o new.npz")
@with_config
def listen(
    config: ReadoutConfig,
    given: frozenset[str],
    port: Port,
    map_: Path | None = opt(None, "--map", "FILE", "taxel of each of the chip's addresses, without polarity"),
    seconds: float | None = opt(None, "duration of the recording [until Ctrl-C]", min=0.0),
    page: Page = None,
    udp: Udp = None,
    baud: Baud = BAUD,
    patience: Patience = 3.0,
    out: Path = out_file(Path("out/heard.npz"), "file for the events"),
) -> None:
    """Record events that another chip sends over four-phase AER to a board.

    --rows, --columns and --encoding describe the array of that chip. Its addresses are {polarity, row, column}, or
    as listed in --map. With --link four_phase_dual the request line gives the polarity. Times are in clocks of the
    board. Ctrl-C ends and saves the recording.
    """
    from eskin.board import session
    from eskin.board.link import Link
    from eskin.board.live import View
    from eskin.skin.foreign.address_map import AddressMap

    mapping = AddressMap.read(map_) if map_ is not None else None
    if mapping is not None:
        sides = dict(zip(("rows", "columns"), mapping.size, strict=True))
        config = config.replace(**{name: side for name, side in sides.items() if name not in given})
        if config.rows < sides["rows"] or config.columns < sides["columns"]:
            raise InputError(
                f"{map_} needs {sides['rows']} rows and {sides['columns']} columns; leave --rows and --columns out"
            )
    received = session.Received(session.foreign_events(config, mapping), keep=False)
    with Link(port, received, baud, patience) as link:
        clock_hz = link.hello("receiver")["clock_hz"]
        fits = session.foreign_config(config, clock_hz)
        view = View(config, clock_hz, WINDOW_S)
        with session.recording(out, fits, {"board": port}, received), _shown(view, page, udp, received, link):
            session.listen(link, received, seconds)
            received.observed = session.observed_clocks(received)
    echo(f"{received.count} events in {received.observed / clock_hz:.3f} s; {out}")
    if lost := received.counts.get("lost", 0):
        common.fail(f"LOST {lost} events: the chip sent them faster than the serial line can carry")


@command("Board", needs="board", fuzz="good/nothing.npz --port good/nothing")
def load(weights: Network, port: Port, baud: Baud = BAUD, patience: Patience = 3.0) -> None:
    """Load the weights of a network into a board, and verify them."""
    from eskin.board import session
    from eskin.board.link import Link
    from eskin.model.classifier.file import IntegerWeights

    network = IntegerWeights.load(weights)
    with Link(port, lambda records: None, baud, patience) as link:
        link.hello("player", session.board_of(network))
        session.load(link, network)
    print(f"loaded {network.network.config.memory_bits / 8192:.1f} kB of weights")


@command("Board", needs="board", fuzz="good/nothing.npz.part")
def rescue(journal: Path = arg(..., "FILE.npz.part", "partial file of a killed recording")) -> None:
    """Convert the partial file of a killed recording into an event file."""
    from eskin.board.journal import convert

    recording = convert(journal)
    echo(f"{len(recording.events)} events; {journal.with_suffix('')}")


@contextmanager
def sending(udp: str | None, clock_hz: float) -> Iterator[UdpSender | None]:
    """Yield a UDP sender of events, or None without a destination; warn at the end if datagrams were not sent."""
    from eskin.board.udp import UdpSender

    if udp is None:
        yield None
        return
    with closing(UdpSender(udp, clock_hz)) as sender:
        try:
            yield sender
        finally:
            if sender.failed:
                warn([f"{sender.failed} datagrams were not sent to {udp}: {sender.reason}; check --udp"])


@contextmanager
def _shown(view: View, page: int | None, udp: str | None, received: Received, link: Link) -> Iterator[None]:
    """Show the data from the board live: in the terminal, in a browser, and over UDP."""
    from eskin.board.live import served

    received.watch = lambda records, events: view(records, events, link.waited_s())
    with ExitStack() as stack:
        view.sender = received.forward = stack.enter_context(sending(udp, view.clock_hz))
        if page is not None:
            port = stack.enter_context(served(view, page))
            print(f"http://127.0.0.1:{port}/", file=sys.stderr, flush=True)
        if watched():
            from rich.console import Console, Group
            from rich.live import Live
            from rich.text import Text

            def picture() -> Group:
                said = view.state(view.number, since=view.clock)  # without the steps
                facts = f"{said['seconds']:.3f} s, {said['events']} events, {view.bins} bins, {said['lost']} lost"
                words = f"class {said['class']}; " if said["class"] is not None else ""
                return Group(*map(Text, view.raster(lines=16)), Text(words + facts))

            stack.enter_context(Live(get_renderable=picture, console=Console(stderr=True), refresh_per_second=10))
        yield
