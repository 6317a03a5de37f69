"""Coverage points of a board: serial line, frames, errors, queries, records, and another chip."""

from __future__ import annotations

from collections.abc import Iterator

from eskin.board.config import BoardConfig
from eskin.board.records import Reason
from eskin.board.serial_frames import MOST_PAYLOAD
from eskin.verify.coverage.points.classifier import loads
from eskin.verify.coverage.points.point import Named, Point, began, points_of


def board(config: BoardConfig) -> Iterator[Point]:
    """Yield the coverage points of a board design."""
    group = f"board, {config.design}"
    for module, found in (
        ("eskin_board_uart_receiver", _line()),
        ("eskin_board_frames", _frames()),
        ("eskin_board_core", _core(config)),
        ("eskin_board_core", _player(config) if config.chip else _receiver()),
        ("eskin_board_core_recorder", _records(config)),
        ("eskin_board_core_sender", _sender()),
    ):
        yield from points_of(group, module, found)


def _line() -> Named:
    """Yield the points of the serial line to the board."""
    yield "lowest byte", "valid && data == 8'h00"
    yield "highest byte", "valid && data == 8'hff"
    yield "noise shorter than a start bit", "fsm_state == 0 && $past(fsm_state) == 1 && !rst"
    yield "start bit right behind a stop bit", "fsm_state == 1 && $past(fsm_state) == 0 && $past(fsm_state, 2) == 2"
    yield "line that stays low", "fsm_state == 2 && !line && $past(fsm_state, 8) == 2"
    yield "reset within a byte", began("fsm_state == 1")


def _frames() -> Named:
    """Yield the points of accepted frames, and of frames rejected for each reason."""
    yield "frame taken", "taken && !session"
    yield "session begun", "session"
    for reason in (Reason.DAMAGED, Reason.SEQUENCE, Reason.OVERRUN):
        yield f"frame refused: {reason.name.lower()}", f"refused && refused_reason == {int(reason)}"
    yield "frame that stops", "late"
    yield "no room for a byte", "full && byte_valid && byte_ != 8'h7e"
    yield "escape", "byte_valid && byte_ == 8'h7d"
    yield "flag behind a flag", "byte_valid && byte_ == 8'h7e && count == 0"
    yield "longest frame taken", f"byte_valid && byte_ == 8'h7e && count == {MOST_PAYLOAD + 7}"
    yield "frame longer than any", f"byte_valid && count > {MOST_PAYLOAD + 7}"
    yield "number 0 is due behind 255", "refused && refused_expected == 0 || taken && $past(refused_expected) == 255"
    yield "reset within a frame", began("count != 0")


def _core(config: BoardConfig) -> Named:
    """Yield the points of queries, pending rejections, sessions, and resets at any time."""
    yield "restart", "restart"
    yield "status asked for", "status_valid && status_ready"
    for end in (0, 255):
        yield f"frame {end} acknowledged", f"ack_valid && ack_ready && ack_sequence == {end}"
    yield "acknowledgement waits", "ack_valid && !ack_ready"
    yield "kind that is none, or of a wrong length", "unknown_valid && unknown_ready"
    yield "board says what it is", "hello_ready"
    yield "refusal told", "refused_ready"
    yield "frame refused while a refusal waits", "refused && refused_valid"
    yield "frame refused", "refused && !refused_valid"
    for name, state in (
        ("the board speaks", "byte_valid"),
        ("a record is written", "!idle"),
        ("a status waits", "status_valid"),
        ("frames wait", "valid"),
    ):
        yield f"session begins while {name}", f"session && {state}"
    for name, state in (("the board speaks", "byte_valid"), ("a record is written", "!idle")):
        yield f"reset while {name}", began(state)
    yield "session begins at rest", "session && !byte_valid && idle"


def _player(config: BoardConfig) -> Named:
    """Yield the points of samples, clocks and weights, and of their results."""
    assert config.chip is not None
    yield "event alone", "event_valid && !class_valid && idle"
    yield "class alone", "class_valid && !event_valid && idle"
    yield "chip waits while something is written", "active && !idle"
    yield "sample tick", "sample_valid && run"
    yield "sample tick waits", "sample_valid && !run && active"
    yield "bytes of samples come while the chip runs", "run && valid && ready"
    yield "frame waits for the chip", "active && valid && !ready"
    yield "taxel falls", "loader.falling != 0"
    yield "short event", "recorder.left != 0"
    yield "short event waits and the line rests", "recorder.rests && recorder.filled != 0"
    yield "clocks are over", "!active && $past(active) && !session && !rst"
    yield from loads(config.chip.classifier)
    yield "session begins while the chip runs", "session && active"
    yield "reset while the chip runs", began("active")


def _receiver() -> Named:
    """Yield the points of a board that records another chip: its link, stored events, lost events."""
    yield "event kept", "event_valid && idle"
    yield "event waits for a record", "event_valid && !idle"
    yield "event lost", "aer.lost_now"
    yield "further event lost", "aer.lost_now && aer.lost != 0"
    yield "losses told", "recorder.lost_told"
    yield "REQ rises", "aer_req && !$past(aer_req)"
    yield "REQ of OFF rises", "aer_req_off && !$past(aer_req_off)"
    yield "ACK and REQ high", "aer_ack && aer_req"
    yield "ACK high, REQ low", "aer_ack && !aer_req"
    yield "lowest address", "event_valid && idle && recorder.event_address == 0"
    yield "highest address", "event_valid && idle && &recorder.event_address"
    yield "session begins while ACK is high", "session && aer_ack"
    yield "REQ is high as a session has begun", "aer_req && !aer_ack && $past(session)"
    yield "reset while ACK is high", began("aer_ack")
    yield "reset while REQ is high", began("aer_req && !aer_ack")


def _records(config: BoardConfig) -> Named:
    """Yield the points of words that wait for the serial line."""
    yield "a word finds no room", "w_en && !w_rdy"
    yield "memory full", f"level == {config.serial.records}"
    yield "memory empty", "level == 0 && !rst"
    yield "high bits of the time told", "told != 0"
    yield "reset while words wait", began("level != 0")


def _sender() -> Named:
    """Yield the points of frames to the host."""
    yield "frame of one word", "words == 1 && $past(words) == 0"
    yield "longest frame", f"words == {MOST_PAYLOAD // 4}"
    yield "flag stuffed", "valid && ready && byte_ == 8'h7d"
    yield "number 0 behind 255", "sequence_ == 0 && $past(sequence_) == 255"
    yield "number that is stuffed", "sequence_ == 8'h7e || sequence_ == 8'h7d"
    yield "words wait when a frame ends", "level != 0 && sequence_ != $past(sequence_)"
