"""The command demo: a simulated board with a live page (docs/guide/demo.md)."""

from __future__ import annotations

import os
import sys
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eskin.app.cli import echo
from eskin.app.commands.board.board import Udp, sending
from eskin.app.commands.signals.recordings import DEFAULTS, PREPARATION, named_place, scale_text
from eskin.app.options import RECORDINGS, arg, command, opt, with_fields
from eskin.base.units import counted
from eskin.model.config import ReadoutConfig
from eskin.skin.recordings.options import Preparation

if TYPE_CHECKING:
    from eskin.board.demo import DemoResult


@command("A first look", needs="board", fuzz="good/nothing.npz --no-browser --port 0")
@with_fields(ReadoutConfig, ("encoding", "resolution", "sample_rate_hz"), "readout")
@with_fields(Preparation, PREPARATION, "prepared", DEFAULTS, RECORDINGS)
def demo(
    source: Path | None = arg(
        None,
        "[INPUT|finger]",
        "image, recording, folder of class folders, or finger, the project's own recordings [textures]",
        callback=named_place,
    ),
    weights: Path | None = opt(
        None, "INTEGER.npz", "integer network [from eskin quantise for these recordings; embedded]"
    ),
    port: int = opt(8000, "port of the live page; 0 for any free port", min=0, max=65535),
    browser: bool = opt(True, "open the page in a browser"),
    udp: Udp = None,
    speed: float | None = opt(
        None, "playback speed, recorded seconds per second [1, slower for short inputs]", min=1e-4
    ),
    only: str | None = opt(None, "image or recording, by name"),
    limit: int | None = opt(None, "number of images or recordings [until Ctrl-C]", min=1),
    readout: dict[str, Any] | None = None,
    prepared: dict[str, Any] | None = None,
) -> None:
    """Show a simulated board on a live page in the browser: textures, your image, or your recordings.

    Images run through readout and classifier. Recordings run through the readout, and if a network was trained and
    quantised for their folder, also through the classifier.
    """
    from eskin.board import demo as player
    from eskin.board.live import served

    show = player.show_of(source, weights, only, readout, prepared)
    view = player.new_view(show)
    found: list[DemoResult] = []
    with sending(udp, view.clock_hz) as sender, served(view, port, "--port") as served_at:
        address = f"http://127.0.0.1:{served_at}/"
        print(f"{address} shows the skin; Ctrl-C stops the demo", flush=True)
        if show.scale is not None:
            print(scale_text(show.scale), flush=True)
        if show.weights is not None and weights is None:
            echo(f"network: {show.weights}", flush=True)
        print("preparing the model: half a minute the first time", file=sys.stderr, flush=True)
        if browser and (sys.platform in ("darwin", "win32") or {"DISPLAY", "WAYLAND_DISPLAY"} & set(os.environ)):
            webbrowser.open(address)
        try:
            for one in player.play(show, view, speed, sender, hold_s=1.5):
                found.append(one)
                echo(_line(one), flush=True)
                if len(found) == limit:
                    break
        except KeyboardInterrupt:
            print(file=sys.stderr)
    known = [one for one in found if one.truth is not None and one.found is not None]
    right = f", {sum(one.truth == one.found for one in known)} of {len(known)} classes right" if known else ""
    print(f"played {counted(len(found), 'recording')}{right}")


def _line(one: DemoResult) -> str:
    if one.found is None:
        return f"{one.name}: {one.events} events"
    verdict = "" if one.truth is None else ", right" if one.truth == one.found else f", wrong: it is {one.truth}"
    return f"{one.name}: {one.found}{verdict}; {one.events} events"
