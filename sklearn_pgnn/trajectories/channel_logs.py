"""Logs of channels with separate clocks: MDF, versions 2 to 4, and bags of ROS 1 and ROS 2."""

import os
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from sklearn_pgnn.annotations import FilePath
from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.extras import needed_by
from sklearn_pgnn.trajectories.channels import Channel, ChannelLog

if TYPE_CHECKING:
    from asammdf import MDF
    from rosbags.highlevel import AnyReader

# -- automotive measurement files ------------------------------------------------------------------


class MdfLog(ChannelLog):
    """An MDF file; a channel whose name occurs in several groups is called ``GROUP.name``."""

    def __init__(self, path: str):
        with needed_by("Reading an MDF file"):
            import asammdf  # noqa: F401
        super().__init__(path)

    @cached_property
    def _places(self) -> dict[str, tuple[int, int]]:
        """Group and number of every channel by title; the groups' clocks are no channels."""
        found = {}
        with self._open() as file:
            for name, places in file.channels_db.items():
                own = [(g, k) for g, k in places if file.masters_db.get(g) != k]
                for group, number in own:
                    called = name if len(own) == 1 else f"{group}.{name}"
                    unit = file.get_channel_unit(group=group, index=number)
                    found[f"{called} [{unit}]" if unit else called] = group, number
        return found

    @property
    def titles(self) -> list[str]:
        """Names of the channels with their units."""
        return [*self._places]

    def load(self, titles: list[str]) -> dict[str, Channel]:
        """Return the requested channels, without the samples that the file marks as invalid."""
        with self._open() as file:
            return {title: self._channel(title, file) for title in titles}

    def _channel(self, title: str, file: "MDF") -> Channel:
        group, number = self._places[title]
        signal = file.get(group=group, index=number).validate()
        values = np.asarray(signal.samples)
        if values.dtype.kind not in "biuf" or values.ndim != 1:
            raise RecordError(
                f"{self.path}: channel {title!r}: expected a number a sample, got {values.dtype} "
                f"of shape {values.shape}."
            )
        return Channel(np.asarray(signal.timestamps, dtype=float), values.astype(float))

    def _open(self) -> "MDF":
        from asammdf import MDF

        return MDF(self.path)


# -- bags: the numbers in the messages of their topics ---------------------------------------------

#: file that identifies a folder as a bag of ROS 2
METADATA = "metadata.yaml"
#: longest array of a message whose elements become channels; longer ones are images and scans
LONGEST = 64


class BagLog(ChannelLog):
    """A bag of ``/topic/field/0``, by the stamps in headers, else the time of receiving."""

    def __init__(self, path: str):
        with needed_by("Reading a ROS bag"):
            import rosbags  # noqa: F401
        super().__init__(path)

    @cached_property
    def titles(self) -> list[str]:
        """Names of the channels, taken from the first message of every topic."""
        found: list[str] = []
        with self._open() as bag:
            for topic in dict.fromkeys(connection.topic for connection in bag.connections):
                own = [connection for connection in bag.connections if connection.topic == topic]
                for connection, _, raw in bag.messages(connections=own):
                    message = bag.deserialize(raw, connection.msgtype)
                    found += [topic + name for name, _ in numbers(message)]
                    break
        return found

    def load(self, titles: list[str]) -> dict[str, Channel]:
        """Return the requested channels, sorted by time."""
        rows: dict[str, list[tuple[int, float]]] = {title: [] for title in titles}
        with self._open() as bag:
            wanted = [
                c for c in bag.connections if any(t.startswith(f"{c.topic}/") for t in titles)
            ]
            for connection, received, raw in bag.messages(connections=wanted):
                message = bag.deserialize(raw, connection.msgtype)
                when = _stamp(message) or received
                for name, value in numbers(message):
                    title = connection.topic + name
                    if title in rows:
                        rows[title].append((when, value))
            start = bag.start_time
        return {title: _channel(found, start) for title, found in rows.items()}

    def _open(self) -> "AnyReader":
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore

        return AnyReader([Path(self.path)], default_typestore=get_typestore(Stores.LATEST))


def is_bag_folder(path: FilePath) -> bool:
    """Return whether a path is the folder of a bag of ROS 2."""
    return os.path.isfile(os.path.join(path, METADATA))


def numbers(message: object, path: str = "") -> Iterator[tuple[str, float]]:
    """Yield the numbers in a message but its header, each with its field's path, ``/field``."""
    if isinstance(message, bool | int | float | np.number | np.bool_):
        yield path, float(message)
    elif isinstance(message, list | tuple | np.ndarray):
        for k, item in enumerate(message if len(message) <= LONGEST else ()):
            yield from numbers(item, f"{path}/{k}")
    else:
        for name in getattr(message, "__dataclass_fields__", ()):
            if name not in ("header", "__msgtype__"):
                yield from numbers(getattr(message, name), f"{path}/{name}")


def _stamp(message: object) -> int:
    """Return the time stamp of a message's header [ns], 0 if there is none."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    return 0 if stamp is None else int(stamp.sec) * 10**9 + int(stamp.nanosec)


def _channel(rows: list[tuple[int, float]], start: int) -> Channel:
    when = np.array([time for time, _ in rows], dtype=np.int64)
    values = np.array([value for _, value in rows], dtype=float)
    order = np.argsort(when, kind="stable")
    return Channel((when[order] - start) * 1e-9, values[order])
