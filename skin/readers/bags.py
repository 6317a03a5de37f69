"""Read recordings of robots: ROS 1 bags, ROS 2 bags and MCAP files, a topic of numbers at a time."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from eskin.base.errors import InputError
from eskin.base.inputs import check_ends
from eskin.skin.readers.arrays import needed
from eskin.skin.readers.frame import Frame, check_size


def read_bag(path: Path, topic: str, field: str) -> Frame:
    """Return the numbers of a topic of a bag: a sample for each message, with its time stamp.

    - ``path``: a ``.bag`` file of ROS 1, a ``.mcap`` file, a ``.db3`` file of ROS 2, or the folder of a ROS 2 bag.
    - ``topic``: its name; not needed if only one topic holds numbers.
    - ``field``: field of the message, such as ``data`` or ``wrench.force``; by default all its numbers.

    Raise InputError if the bag cannot be read, or the topic or field is missing; the message lists them.
    """
    highlevel = needed("rosbags.highlevel", path)
    typesys = needed("rosbags.typesys", path)
    place = (
        path.parent if path.suffix.lower() in (".db3", ".mcap") and (path.parent / "metadata.yaml").exists() else path
    )
    for one in [path, *(place.iterdir() if place.is_dir() else ())]:  # the reader opens them, and waits for their end
        check_ends(one)
    store = typesys.get_typestore(typesys.Stores.LATEST)
    try:
        with highlevel.AnyReader([place], default_typestore=store) as reader:
            return _read(path, reader, topic, field)
    except InputError:
        raise
    except Exception as error:  # the readers raise many types, depending on what is damaged
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{path} is damaged or not a bag that can be read ({reason}); record it again") from None


def _read(path: Path, reader: Any, topic: str, field: str) -> Frame:
    import pandas

    topics = {one.topic: one for one in reader.connections}
    listed = ", ".join(f"{one.topic} ({one.msgtype}, {one.msgcount} messages)" for one in topics.values()) or "none"
    if not topic:
        numeric = [name for name, one in topics.items() if _first_numbers(reader, one, "")]
        if len(numeric) != 1:
            raise InputError(f"{path} has the topics {listed}; choose one with --topic NAME")
        topic = numeric[0]
    if topic not in topics:
        raise InputError(f"{path} has no topic {topic!r}; it has {listed}")
    chosen = [one for one in reader.connections if one.topic == topic]
    names, rows, times = None, list[list[float]](), list[int]()
    for connection, stamp, raw in reader.messages(connections=chosen):
        message = reader.deserialize(raw, connection.msgtype)
        found = list(_numbers(_part(path, message, field)))
        if names is None:
            names = [name or field or "data" for name, _ in found]
            if not names:
                raise InputError(
                    f"{path}: {topic} has no numbers{' in ' + field if field else ''}; choose another --field"
                )
        if len(found) != len(names):
            raise InputError(
                f"{path}: message {len(rows) + 1} of {topic} has {len(found)} numbers, the first has {len(names)}; "
                f"choose a field of fixed length with --field"
            )
        rows.append([value for _, value in found])
        times.append(_stamp(message, stamp))
        check_size(path, len(rows) * len(names))
    if names is None:
        raise InputError(f"{path}: {topic} has no messages; choose another with --topic, of {listed}")
    cells = pandas.DataFrame(np.array(rows))
    cells.insert(0, "time", np.array(times, np.int64))
    cells = cells.set_axis(range(len(names) + 1), axis=1)
    note = f"the samples are the messages of {topic}; --topic and --field choose others"
    return Frame(cells, ("timestamp_ns", *names), True, (note,))


def _first_numbers(reader: Any, connection: Any, field: str) -> bool:
    """Return True if the first message of a topic holds numbers."""
    for one, _, raw in reader.messages(connections=[connection]):
        try:
            return any(True for _ in _numbers(reader.deserialize(raw, one.msgtype)))
        except Exception:  # a message of an unknown type
            return False
    return False


def _part(path: Path, message: Any, field: str) -> Any:
    """Return a field of a message, such as ``wrench.force``."""
    for name in field.split(".") if field else ():
        if not hasattr(message, name):
            known = (
                ", ".join(one.name for one in dataclasses.fields(message)) if dataclasses.is_dataclass(message) else ""
            )
            raise InputError(f"{path}: a message has no field {name!r}; it has {known or 'no fields'}")
        message = getattr(message, name)
    return message


def _numbers(value: Any, name: str = "") -> Iterator[tuple[str, float]]:
    """Yield name and value of every number in a message, without its header and layout."""
    if isinstance(value, (bool, str, bytes)):
        return
    if isinstance(value, (int, float, np.integer, np.floating)):
        yield name, float(value)
    elif isinstance(value, np.ndarray) and value.dtype.kind in "iuf":
        yield from ((f"{name}{k}", float(one)) for k, one in enumerate(value.ravel()))
    elif isinstance(value, (list, tuple, np.ndarray)):
        for k, one in enumerate(value):
            yield from _numbers(one, f"{name}{k}.")
    elif dataclasses.is_dataclass(value):
        for part in dataclasses.fields(value):
            if part.name not in ("header", "layout", "stamp"):
                inner = getattr(value, part.name)
                yield from _numbers(
                    inner, f"{name}{part.name}." if dataclasses.is_dataclass(inner) else f"{name}{part.name}"
                )


def _stamp(message: Any, received: int) -> int:
    """Return the time of a message in nanoseconds: of its header, else of its arrival."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    taken = int(stamp.sec) * 10**9 + int(stamp.nanosec) if stamp is not None else 0
    return taken or received
