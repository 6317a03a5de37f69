"""Host functions for a board: load weights, play samples, collect results, record another chip."""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.board.changes import ChangeCoder, whole_tick
from eskin.board.config import ADDRESS_BITS, BOTH_FLAG, OFF_FLAG, BoardConfig
from eskin.board.journal import Journal
from eskin.board.link import Link
from eskin.board.records import Class, Event, Feature, Lost, Record, Tag, Words, classes_of
from eskin.board.serial_frames import MAX_PAYLOAD, Kind
from eskin.board.udp import AddressEvent
from eskin.model.address_events import EVENT_DTYPE, Events
from eskin.model.classifier.chip import clocks_of, events_of, simulate_chip
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.file import IntegerWeights, neuron_image, weight_image
from eskin.model.config import ReadoutConfig
from eskin.model.events.compare import first_difference
from eskin.model.links.four_phase import FourPhase
from eskin.skin.foreign.address_map import AddressMap
from eskin.skin.recordings.trained_on import TrainingNotes

MAX_CLOCKS = 1 << 24  # of one RUN: a running board without events sends nothing
SENSE_S = 0.1  # time that a board reads its skin for one frame of the host; the next frame waits on the board
MAX_SCANS = (1 << 16) - 1
ASK_S = 0.5  # time between requests for the counters, which show that a board is still there


@dataclass
class Received:
    """Events, classes and counters received from a board so far."""

    to_event: Callable[[Event], AddressEvent]  # clock, column, row and polarity of an event
    journal: Journal | None = None
    forward: Callable[[list[AddressEvent]], object] | None = None  # sends events on, once the journal has them
    watch: Callable[[list[Record], list[AddressEvent]], object] | None = None  # gets all records, and their events
    keep: bool = True  # events in memory too; without, only the journal has the events of an endless recording
    events: list[AddressEvent] = field(default_factory=list)
    classes: list[Class] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=dict)
    lost: int = 0
    observed: int = 0  # clocks, known at the end
    count: int = 0

    def __call__(self, records: list[Record]) -> None:
        """Add the records of a frame."""
        events: list[AddressEvent] = []
        try:
            for record in records:
                if isinstance(record, Event):
                    events.append(self.to_event(record))
                    self.count += 1
                elif isinstance(record, Class):
                    self.classes.append(record)
                elif isinstance(record, Lost):
                    self.lost += record.count
                elif isinstance(record, Words) and record.tag == Tag.STATUS:
                    self.counts = record.values
        finally:
            if self.journal:
                self.journal.add(events)
            if self.keep:
                self.events += events
            if self.forward and events:
                self.forward(events)
        if self.watch:
            self.watch(records, events)


def player_events(config: ChipConfig) -> Callable[[Event], AddressEvent]:
    """Return a function that converts a chip's input channel to an event."""
    channels = config.classifier.inputs
    table = events_of(config, np.zeros(channels, np.int64), np.arange(channels)).tolist()

    def to_event(event: Event) -> AddressEvent:
        _, column, row, polarity = table[event.address]
        return event.time, column, row, polarity

    return to_event


def foreign_events(config: ReadoutConfig, mapping: AddressMap | None = None) -> Callable[[Event], AddressEvent]:
    """Return a function that converts an address {polarity, row, column} of another chip to an event.

    Where the request names the polarity, the address is {row, column}. A map gives the taxel of each address, or of
    each column and row, without the polarity. The function raises InputError for an address that the array does not
    have, and for two requests at once.
    """
    dual = config.protocol.request_has_polarity
    places = [(column, row) for row in range(config.rows) for column in range(config.columns)]
    sources: Mapping[tuple[int, ...], tuple[int, int]] = mapping.taxels if mapping else {one: one for one in places}
    across = max(source[0] for source in sources).bit_length()
    taxels = {sum(n << across * at for at, n in enumerate(source)): taxel for source, taxel in sources.items()}
    above = max(taxels).bit_length()
    if min(taxels) < 0 or max(taxels) >= (BOTH_FLAG if dual else 1 << ADDRESS_BITS - config.has_polarity):
        raise InputError(
            f"a board record has room for {ADDRESS_BITS} address bits (polarity included); map to lower addresses"
        )
    off, on = (OFF_FLAG, 0) if dual else (0, config.has_polarity << above)
    table = {on | address: (*taxel, True) for address, taxel in taxels.items()}
    if config.has_polarity:
        table |= {off | address: (*taxel, False) for address, taxel in taxels.items()}

    def to_event(event: Event) -> AddressEvent:
        try:
            return event.time, *table[event.address]
        except KeyError:
            if dual and event.address & BOTH_FLAG:
                raise InputError("the chip requested ON and OFF at once; check the wires of both requests") from None
            sent = f"the foreign chip sent the address {event.address:#x}, which"
            if mapping is not None:
                raise InputError(f"{sent} {mapping.name} does not map; add a line for this address") from None
            raise InputError(
                f"{sent} {config.rows} x {config.columns} taxels of {config.encoding} do not have; give the rows, "
                f"columns and encoding of the foreign chip"
            ) from None

    return to_event


@contextmanager
def recording(path: Path, config: ReadoutConfig, metadata: dict[str, Any], received: Received) -> Iterator[None]:
    """Write events to a file as they arrive, and save the received events even after an error."""
    journal = Journal(path, config, metadata)
    received.journal = journal
    try:
        yield
    except InputError as error:
        if not journal.count:
            journal.discard()
            raise
        journal.finish(None, lost=received.lost, stopped=str(error))
        raise InputError(f"{error}; {journal.count} events received before are in {path}") from None
    except BaseException:
        journal.finish(None, lost=received.lost, stopped="interrupted")
        raise
    journal.finish(received.observed, lost=received.counts.get("lost", received.lost))


def weight_frames(weights: IntegerWeights, word_bytes: int) -> Iterator[bytes]:
    """Yield the payloads (memory, first address, words) of the frames that write both weight memories."""
    network = weights.network
    size = (MAX_PAYLOAD - 3) // word_bytes
    for neurons, image in enumerate((weight_image(network), neuron_image(network))):
        for at in range(0, len(image), size):
            words = b"".join(word.to_bytes(word_bytes, "little") for word in image[at : at + size])
            yield bytes([neurons]) + at.to_bytes(2, "little") + words


def load(link: Link, weights: IntegerWeights) -> None:
    """Write weights into the memories of a board and reset its chip."""
    if not link.said["word_bytes"]:
        raise InputError("the board reports word_bytes = 0, so no memory takes its weights; load its bitstream again")
    for payload in weight_frames(weights, link.said["word_bytes"]):
        link.send(Kind.WEIGHTS, payload)
    link.wait()


def play(link: Link, chip: ChipConfig, samples: NDArray[Any], whole: bool = False) -> int:
    """Play samples, shape (ticks, taxels), on a board after a reset; return the clocks of the chip.

    With ``whole``, samples have 16 bits and events 32 bits, as for a board of the first protocol.
    """
    clocks = clocks_to_play(chip, len(samples))
    features = Feature(0) if whole else link.features
    link.send(Kind.RESTART, b"\x01" if features & Feature.SHORT_EVENTS else b"")
    if features & Feature.CHANGES:
        parts = ChangeCoder(chip.readout).feed(samples)
    else:
        parts = (part for codes in samples for part in whole_tick(codes))
    for kind, payload, _ in parts:
        link.send(kind, payload)
    _finish(link, clocks - len(samples) * chip.readout.clocks_per_sample)
    return clocks


def sense(link: Link, chip: ChipConfig, ticks: int | None = None) -> int:
    """Let a board read its own skin for a number of ticks, or until Ctrl-C; return the clocks of its chip."""
    if not link.features & Feature.SENSOR:
        raise InputError("the board has no converter of its own; build its bitstream with make fpga ADC=")
    link.send(Kind.RESTART, b"\x01")
    part, done = min(max(round(chip.readout.sample_rate_hz * SENSE_S), 1), MAX_SCANS), 0
    try:
        while ticks is None or done < ticks:
            scans = part if ticks is None else min(part, ticks - done)
            link.send(Kind.SENSE, scans.to_bytes(2, "little"))
            done += scans
            while link.unfinished > 1:
                link.receive()
    except KeyboardInterrupt:
        pass
    clocks = clocks_to_play(chip, done)
    _finish(link, clocks - done * chip.readout.clocks_per_sample)
    return clocks


def _finish(link: Link, left: int) -> None:
    """Run the clocks after the last sample, and wait for the last record."""
    while left:
        part = min(left, MAX_CLOCKS)
        link.send(Kind.RUN, part.to_bytes(4, "little"))
        left -= part
    link.send(Kind.STATUS)
    link.wait()


def clocks_to_play(chip: ChipConfig, ticks: int) -> int:
    """Return the clocks needed to process all samples and to report the class of the last complete bin."""
    return max(clocks_of(chip, ticks)[1], ticks * chip.readout.clocks_per_sample)


def as_events(received: Iterable[AddressEvent]) -> Events:
    """Return events (clock, column, row, polarity) as an array."""
    return np.array(list(received), EVENT_DTYPE)


def difference(chip: ChipConfig, weights: IntegerWeights, samples: NDArray[Any], received: Received) -> str | None:
    """Return the first difference between board and models in events or classes, or None."""
    clocks = clocks_to_play(chip, len(samples))
    model = simulate_chip(chip, weights.network, samples, clocks)
    if (found := first_difference(model.events, as_events(received.events))) is not None:
        return found.describe(("model", "board"))
    expected = classes_of(model.classifier, clocks)
    for number, (wanted, got) in enumerate(zip(expected, received.classes, strict=False)):
        if wanted != got:
            return f"bin {number} differs: model {wanted}; board {got}"
    if len(expected) != len(received.classes):
        return f"the model has {len(expected)} bins, the board {len(received.classes)}"
    return None


def listen(link: Link, received: Received, seconds: float | None) -> bool:
    """Record events of another chip until a time limit or Ctrl-C; return True after Ctrl-C."""
    link.send(Kind.RESTART)
    ends, stopped = None if seconds is None else time.monotonic() + seconds, False
    try:
        while ends is None or time.monotonic() < ends:
            link.pause(ASK_S if ends is None else min(ASK_S, max(ends - time.monotonic(), 0)))
            link.wait(link.patience_s)  # for records that were requested before
            link.send(Kind.STATUS)
    except KeyboardInterrupt:
        stopped = True
    link.send(Kind.STATUS)
    link.wait(link.patience_s)
    return stopped


def foreign_config(config: ReadoutConfig, clock_hz: float) -> ReadoutConfig:
    """Return the configuration for a recording of another chip, timed in clocks of the board."""
    clocks = max(round(clock_hz / config.sample_rate_hz), 1)
    if not config.protocol.asynchronous:
        config = config.replace(link=FourPhase.name)
    return config.replace(clocks_per_sample=clocks, sample_rate_hz=clock_hz / clocks)


def observed_clocks(received: Received) -> int:
    """Return the number of clocks since the AER receiver started."""
    return received.counts.get("time_high", 0) << 32 | received.counts.get("time_low", 0)


def board_of(weights: IntegerWeights) -> BoardConfig:
    """Return the board configuration for an integer network."""
    return BoardConfig(chip=chip_of(weights))


def chip_of(weights: IntegerWeights, path: Path | None = None) -> ChipConfig:
    """Return the chip configuration for which an integer network was trained."""
    readout = TrainingNotes.of(weights, path or "the network").readout
    return ChipConfig(readout=readout, classifier=weights.network.config)
