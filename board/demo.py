"""Demo without hardware: a simulated board plays textures or a user's file to the live page (docs/guide/demo.md)."""

import base64
import io
import itertools
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.board import session
from eskin.board.config import ADDRESS_BITS, BoardConfig, SerialConfig
from eskin.board.link import Link
from eskin.board.live import Piece, View
from eskin.board.simulated import SimulatedPlayer, SimulatedReceiver
from eskin.board.stimulus import recordings_of, textures_of
from eskin.board.udp import UdpSender
from eskin.model.address_events import Events
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.file import IntegerWeights
from eskin.model.config import ReadoutConfig
from eskin.skin.encode import IMAGE_SUFFIXES, preparation_of, read_image
from eskin.skin.readers.registry import SUFFIXES
from eskin.skin.recordings.columns import read_one
from eskin.skin.recordings.options import FINGER, Preparation, Scale
from eskin.skin.recordings.trained_on import TrainingNotes, network_of
from eskin.skin.textures.dataset import EMBEDDED
from eskin.skin.textures.physical import PhysicalScan, large_enough
from eskin.skin.textures.presets import preset

NETWORKS = Path(str(resources.files("eskin.model").joinpath("classifier", "networks")))
TEXTURES_NETWORK, FINGER_NETWORK = "embedded/fold-1.npz", "finger/fold-0.npz"
"""Networks of the package ``model``; the demo plays textures and recordings outside their training sets."""

LEAST_S = 6.0  # a shorter recording is slowed down to this time
MAX_WINDOW_S = 10.0
PATIENCE_S = 120.0  # longest computation of the model before its board must answer
BUFFER_BYTES = 1 << 22  # buffer of the simulated board: the host sends a whole recording ahead
POINTS, LINES = 400, 64  # largest number of points and lines of the signals on the page


Load = Callable[[str], tuple[NDArray[Any], Piece]]
"""Returns the codes of a name, shape (ticks, taxels), and their display."""
Inputs = tuple[dict[str, str | None], Load]


@dataclass(frozen=True)
class Show:
    """Inputs of a demo, and the simulated chip."""

    config: ReadoutConfig
    network: IntegerWeights | None  # without a network, events are shown and no class
    names: list[str]  # in the order in which they are played
    load: Load
    scale: Scale | None = None  # factor from the values of recordings to full scale, of all taxels or of each
    weights: Path | None = None  # file of the network, unless it is the project's own

    @property
    def chip(self) -> ChipConfig | None:
        """Configuration of readout and classifier, or None without a network."""
        return session.chip_of(self.network) if self.network else None


@dataclass(frozen=True)
class DemoResult:
    """Result of one input: true class if known, predicted class, and events."""

    name: str
    truth: str | None
    found: str | None
    events: int


def show_of(
    source: Path | None,
    weights: Path | None,
    only: str | None = None,
    readout: Mapping[str, Any] | None = None,
    prepared: Mapping[str, Any] | None = None,
) -> Show:
    """Return the inputs of a demo.

    The source is an image, a recording, or a folder of either in class folders; by default the embedded textures.
    ``only`` is one name of a folder. The default weights for recordings are the newest network trained on a folder of
    this name, and for images and ``FINGER`` the project's own. Other recordings are played without a class, with fields
    of ``ReadoutConfig`` and of ``Preparation``; the defaults are those of ``eskin encode``.
    """
    if source is not None and not source.exists():
        raise InputError(f"{source} does not exist; give an image, a recording, or a folder of them")
    recordings = source if source is not None and _holds_recordings(source) else None
    finger = source is not None and source.resolve() == FINGER.resolve()
    if (set_ := {**(readout or {}), **(prepared or {})}) and (weights or finger or not recordings):
        name = next(iter(set_))
        raise InputError(f"{name} is a setting of the network; leave it out, or play a recording without --weights")
    if recordings and weights is None and not set_:
        weights = network_of(recordings)
    if recordings and weights is None and not finger:
        return _events_of(recordings, only, readout or {}, prepared or {})
    network = IntegerWeights.load(weights or NETWORKS / (FINGER_NETWORK if finger else TEXTURES_NETWORK))
    config = session.chip_of(network, weights).readout
    scale = None
    if recordings:
        found = recordings_of(network, config, recordings)
        taxels = () if finger or found.shaped else found.columns
        names, load = _recordings(found.sources, found.codes, config, taxels)
        scale = found.scale
        unseen = TrainingNotes.of(network).tested
        names = {name: truth for name, truth in names.items() if name in unseen} or names
    else:
        names, load = _images(network, config, source)
    return Show(config, network, _chosen(names, only), load, scale, weights)


def _holds_recordings(source: Path) -> bool:
    if not source.is_dir():
        return source.suffix.lower() not in IMAGE_SUFFIXES
    return any(path.suffix.lower() in SUFFIXES for path in source.rglob("*"))


def _chosen(names: dict[str, str | None], only: str | None) -> list[str]:
    """Return the names in an order that alternates between classes, or only the name ``only``."""
    if only is not None:
        if only not in names:
            raise InputError(f"there is no input {only!r}; the first input is {next(iter(names))}")
        return [only]
    classes: dict[str | None, list[str]] = {}
    for name, truth in names.items():
        classes.setdefault(truth, []).append(name)
    return [name for turn in itertools.zip_longest(*classes.values()) for name in turn if name is not None]


def _events_of(source: Path, only: str | None, readout: Mapping[str, Any], prepared: Mapping[str, Any]) -> Show:
    """Return the show of recordings without a network; the page shows events, but no class."""
    from eskin.skin.recordings.folder import read_set

    config = ReadoutConfig(**readout)
    found = read_set(source, _preparation(source, config, readout, prepared), config, readout, flat=True)
    if found.config.event_bits > ADDRESS_BITS:
        raise InputError(
            f"{found.config.rows} x {found.config.columns} taxels of {found.config.encoding} need addresses of "
            f"{found.config.event_bits} bits, but a board has {ADDRESS_BITS}; play fewer taxels"
        )
    shaped = {"rows", "columns"} & set(readout) or found.shaped
    taxels = () if shaped else found.columns
    names, load = _recordings(found.sources, found.codes, found.config, taxels)
    return Show(found.config, None, _chosen(names, only), load, found.scale)


def _preparation(
    source: Path, config: ReadoutConfig, readout: Mapping[str, Any], prepared: Mapping[str, Any]
) -> Preparation:
    """Return the preparation of a file or folder; a file of other values than full scales is scaled like a folder."""
    if not source.is_dir() and not {"scale", "baseline"} & set(prepared):
        table, _ = read_one(source, Preparation(**prepared), readout.get("sample_rate_hz"))
        if table.codes or np.abs(table.values).max(initial=0.0) > 1:
            return Preparation(**{"baseline": "first"} | dict(prepared))
    return preparation_of(source, config, prepared, readout)


def _recordings(
    sources: Sequence[Any], codes: Sequence[NDArray[Any]], config: ReadoutConfig, taxels: Sequence[str] = ()
) -> Inputs:
    """Return names and classes of recordings, and a function that loads one recording."""
    names = {source.name: source.class_name for source in sources}
    own = {source.name: values for source, values in zip(sources, codes, strict=True)}
    return names, lambda name: (own[name], piece_of(name, own[name], config, names[name], taxels))


def _images(network: IntegerWeights, config: ReadoutConfig, source: Path | None) -> Inputs:
    """Return names and classes of images, and a function that scans one image."""
    if source is not None and not source.is_dir():
        names: dict[str, str | None] = {source.name: None}
        read: Callable[[str], NDArray[Any]] = lambda name: read_image(source)  # noqa: E731
    else:
        data, unseen = textures_of(network, str(source) if source else EMBEDDED)
        images = {texture.name: texture for texture in data if texture.name in unseen}
        known = set(network.class_names)
        names = {name: one.class_name if one.class_name in known else None for name, one in images.items()}
        read = lambda name: images[name].load()  # noqa: E731
    training = TrainingNotes.of(network)
    if training.preset is None:
        raise InputError("these weights were trained on recordings; give a folder of recordings to play")
    scan = preset(training.preset, training.wiring)

    def load(name: str) -> tuple[NDArray[Any], Piece]:
        image = read(name)
        image = large_enough(image, config) if source is None else image
        codes, _ = scan.samples(config, image, 0.0)
        picture = picture_of(image, scan, config) if isinstance(scan, PhysicalScan) else None
        return codes, replace(piece_of(name, codes, config, names[name]), picture=picture)

    return names, load


def piece_of(
    name: str, codes: NDArray[Any], config: ReadoutConfig, truth: str | None = None, taxels: Sequence[str] = ()
) -> Piece:
    """Return signals for the live page from codes of shape (ticks, taxels), with the names of taxels, if known."""
    ticks = codes[:: max(-(-len(codes) // POINTS), 1), :: max(-(-codes.shape[1] // LINES), 1)]
    signals = np.round(ticks / config.full_scale, 4)
    seconds = len(codes) / config.sample_rate_hz
    return Piece(name=name, truth=truth, seconds=seconds, signals=signals.T.tolist(), taxels=list(taxels))


def picture_of(image: NDArray[Any], scan: PhysicalScan, config: ReadoutConfig) -> dict[str, Any]:
    """Return the part of an image under the path of the array, and the array's position, for the live page."""
    from PIL import Image

    pitch = scan.taxel_pitch_px
    image = image[: max(image.shape[1] // 4, round(config.rows * pitch))]
    data = io.BytesIO()
    Image.fromarray(np.clip(image, 0, 255).astype(np.uint8)).save(data, "png")
    return {
        "url": f"data:image/png;base64,{base64.b64encode(data.getvalue()).decode()}",
        "width": image.shape[1],
        "height": image.shape[0],
        "left": 0,
        "top": 0,
        "wide": (config.columns - 1) * pitch,
        "high": (config.rows - 1) * pitch,
        "px_per_s": scan.speed_m_per_s / scan.pixel_pitch_m,
    }


def new_view(show: Show) -> View:
    """Return the live view of a demo."""
    chip = show.chip
    if chip is None or show.network is None:
        return View(show.config, SerialConfig().clock_hz, 1.0)
    return View(show.config, chip.clock_hz, 1.0, show.network.class_names, chip.classifier.clocks_per_bin)


def play(
    show: Show, view: View, speed: float | None = None, sender: UdpSender | None = None, hold_s: float = 0.0
) -> Iterator[DemoResult]:
    """Play all inputs in a loop with a pause of ``hold_s`` after each, and yield the result of each.

    The speed is seconds of the skin per second; by default real time, or slower for a short recording.
    """
    view.sender = sender
    for name in itertools.cycle(show.names):
        view.loading = name
        codes, piece = show.load(name)
        piece = replace(piece, speed=speed or min(1.0, piece.seconds / LEAST_S))
        view.begin(piece, min(piece.seconds, MAX_WINDOW_S))
        yield _play_one(show, view, codes, sender)
        if sender:
            sender.begins_us += round(piece.seconds * 1e6)
        time.sleep(hold_s)


def _play_one(show: Show, view: View, codes: NDArray[Any], sender: UdpSender | None) -> DemoResult:
    """Play one input on a simulated board: a player with the network, or a receiver of the model's events."""
    chip, network, board = show.chip, show.network, _board_of(show, codes, view.piece.speed)
    to_event = session.player_events(chip) if chip else session.foreign_events(show.config)
    received = session.Received(to_event, forward=sender, keep=False)
    with board, Link(board.port, received, patience_s=PATIENCE_S) as link:
        received.watch = lambda records, events: view(records, events, link.waited_s())
        link.hello(board.config.design, board.config)
        if chip and network:
            session.load(link, network)
            session.play(link, chip, codes)
        elif isinstance(board, SimulatedReceiver):
            if session.listen(link, received, view.piece.seconds / view.piece.speed):
                raise KeyboardInterrupt
            while received.count < len(board.events):  # a busy machine may be late
                link.receive()
    found = network.class_names[received.classes[-1].winner] if network and received.classes else None
    return DemoResult(view.piece.name, view.piece.truth, found, received.count)


def _board_of(show: Show, codes: NDArray[Any], speed: float) -> SimulatedPlayer | SimulatedReceiver:
    if show.chip:
        return SimulatedPlayer(BoardConfig(chip=show.chip, serial=SerialConfig(buffer_bytes=BUFFER_BYTES)), speed)
    from eskin.model.readout import Stimulus, simulate  # compiles the model

    config = BoardConfig(chip=None)
    events = simulate(show.config, Stimulus.from_samples(show.config, codes))
    return SimulatedReceiver(config, foreign_records(show.config, events, config.serial.clock_hz), speed)


def foreign_records(config: ReadoutConfig, events: Events, clock_hz: float) -> list[tuple[int, int]]:
    """Return clock and address of events, as a board receives events from another chip."""
    above = events["p"].astype(np.int64) if config.has_polarity else np.zeros(len(events), np.int64)
    rows, columns = events["y"].astype(np.int64), events["x"].astype(np.int64)
    addresses = (above << config.row_bits | rows) << config.column_bits | columns
    clocks = np.round(events["t"] * (clock_hz / config.clock_hz)).astype(np.int64)
    return list(zip(clocks.tolist(), addresses.tolist(), strict=True))
