"""Channels with separate clocks, joined into one table of samples.

There is a row at each time at which an output was measured, with NaN in the other outputs.
A held input has its mean over the time to the next row, which has the same effect on the states as
the input itself. With a sample time all channels are resampled.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from functools import partial
from typing import NamedTuple

import numpy as np
import pandas as pd

from sklearn_pgnn.exceptions import RecordError, RecordWarning
from sklearn_pgnn.trajectories.clock import backward, rows_at_one_time
from sklearn_pgnn.trajectories.reader import TIME
from sklearn_pgnn.user_line import warn_user

#: times that differ by less than this fraction of a sample interval are treated as equal
SAME = 1e-6
#: fraction of an output's samples that may lie outside the time of the inputs without a warning
AT_THE_ENDS = 0.01


class Channel(NamedTuple):
    """The samples of a channel, with times [s] on its own clock."""

    t: np.ndarray
    values: np.ndarray


class ChannelLog(ABC):
    """A file of channels, each with its own clock."""

    def __init__(self, path: str):
        self.path = path

    @property
    @abstractmethod
    def titles(self) -> list[str]:
        """Names of the channels, each with its unit in square brackets if it has one."""

    @abstractmethod
    def load(self, titles: list[str]) -> dict[str, Channel]:
        """Return the requested channels, with the time counted from the beginning of the file."""


def join_channels(
    path: str,
    inputs: Mapping[str, Channel],
    states: Mapping[str, Channel],
    outputs: Mapping[str, Channel],
    *,
    hold: str = "zoh",
    sample_time: float | None = None,
) -> pd.DataFrame:
    """Join channels into one table; a `RecordWarning` tells what is left out or apart."""
    inputs, states, outputs = (
        {title: _settled(path, title, channel) for title, channel in part.items()}
        for part in (inputs, states, outputs)
    )
    begin, end = _covered(path, inputs, outputs or states)
    near = SAME * min(_usual_step(channel) for channel in (*inputs.values(), *outputs.values()))
    if sample_time is None:
        t = _rows(outputs or inputs or states, near)
        t = t[(t >= begin - near) & (t <= end + near)]
        seen = partial(_at_own_times, near=near)
    else:
        t = _grid(begin, end, sample_time)
        seen = partial(_resampled, sample_time=sample_time)
    columns = {TIME: t}
    columns |= {title: _run(channel, t, near, hold) for title, channel in inputs.items()}
    columns |= {title: _straight(channel, t) for title, channel in states.items()}
    columns |= {title: seen(channel, t) for title, channel in outputs.items()}
    _tell_what_is_left_out(path, outputs, begin - near, end + near)
    if sample_time is None and any(np.isnan(columns[title]).any() for title in outputs):
        warn_user(
            f"{path}: the outputs have different time stamps; each row holds those measured at its "
            f"time. Remedy, if they share no times at all: give a sample time to resample them "
            f"(--sample-time).",
            RecordWarning,
        )
    return pd.DataFrame(columns)


def _settled(path: str, title: str, channel: Channel) -> Channel:
    """Return a channel with the later of two samples at one time, or refuse its clock."""
    if not channel.t.size:
        raise RecordError(f"{path}: channel {title!r}: expected samples, got none.")
    same = np.diff(channel.values) == 0
    dropped = np.concatenate(rows_at_one_time(channel.t, same))
    kept = Channel(np.delete(channel.t, dropped), np.delete(channel.values, dropped))
    found = backward(kept.t)
    if found is not None:
        before, now = kept.t[found.row - 1 : found.row + 1]
        raise RecordError(
            f"{path}: channel {title!r}: expected time to increase, got {now:.9g} s after "
            f"{before:.9g} s: {found.why}"
        )
    if dropped.size:
        warn_user(
            f"{path}: channel {title!r}: {dropped.size} samples have the time of the next one and "
            f"are left out: the later sample holds from there on.",
            RecordWarning,
        )
    return kept


def _covered(
    path: str, inputs: Mapping[str, Channel], outputs: Mapping[str, Channel]
) -> tuple[float, float]:
    """Return the time span in which all inputs were recorded; without inputs, any output."""
    spans = {title: (channel.t[0], channel.t[-1]) for title, channel in (inputs or outputs).items()}
    if not inputs:
        return min(a for a, _ in spans.values()), max(b for _, b in spans.values())
    late, early = max(spans, key=lambda k: spans[k][0]), min(spans, key=lambda k: spans[k][1])
    begin, end = spans[late][0], spans[early][1]
    if begin > end:
        raise RecordError(
            f"{path}: expected inputs that were recorded at the same time, but {late!r} begins at "
            f"{begin:.6g} s, when {early!r} has ended at {end:.6g} s."
        )
    for title, channel in outputs.items():
        if channel.t[0] > end or channel.t[-1] < begin:
            raise RecordError(
                f"{path}: channel {title!r}: expected samples between {begin:.6g} s and "
                f"{end:.6g} s, where the inputs were recorded, got some from {channel.t[0]:.6g} s "
                f"to {channel.t[-1]:.6g} s."
            )
    return begin, end


def _tell_what_is_left_out(
    path: str, outputs: Mapping[str, Channel], begin: float, end: float
) -> None:
    for title, channel in outputs.items():
        outside = float(np.mean((channel.t < begin) | (channel.t > end)))
        if outside > AT_THE_ENDS:
            warn_user(
                f"{path}: channel {title!r}: {outside:.0%} of the samples are left out: all inputs "
                f"were recorded only from {begin:.6g} s to {end:.6g} s. Remedy: record the inputs "
                f"as long as the outputs, at least at the beginning and the end.",
                RecordWarning,
            )


def _usual_step(channel: Channel) -> float:
    return float(np.median(np.diff(channel.t))) if channel.t.size > 1 else np.inf


# -- rows ------------------------------------------------------------------------------------------


def _rows(channels: Mapping[str, Channel], near: float) -> np.ndarray:
    """Return all times at which one of the channels was measured."""
    t = np.unique(np.concatenate([channel.t for channel in channels.values()]))
    return t[np.append(True, np.diff(t) > near)]


def _grid(begin: float, end: float, step: float) -> np.ndarray:
    """Return equally spaced times; the last may exceed the end by a rounding error."""
    return begin + step * np.arange(int((end - begin) / step + SAME) + 1)


# -- values ----------------------------------------------------------------------------------------


def _run(channel: Channel, t: np.ndarray, near: float, hold: str) -> np.ndarray:
    """Return an input at the rows; if it is held, its mean until the next row."""
    if hold == "foh":
        return np.interp(t, *channel)
    place = np.clip(np.searchsorted(channel.t, t + near, side="right") - 1, 0, None)
    found = channel.values[place]
    areas = np.concatenate([[0.0], np.cumsum(channel.values[:-1] * np.diff(channel.t))])
    until_now = areas[place] + found * np.maximum(t - channel.t[place], 0.0)
    next_place = np.searchsorted(channel.t, t[1:] - near, side="left") - 1
    changes = np.flatnonzero(next_place > place[:-1])
    found[changes] = (np.diff(until_now) / np.diff(t))[changes]
    return found


def _straight(channel: Channel, t: np.ndarray) -> np.ndarray:
    return np.interp(t, *channel, left=np.nan, right=np.nan)


def _at_own_times(channel: Channel, t: np.ndarray, near: float) -> np.ndarray:
    """Return the values at the rows at which they were measured, NaN at the others."""
    place = np.clip(np.searchsorted(channel.t, t - near), 0, channel.t.size - 1)
    return np.where(np.abs(channel.t[place] - t) <= near, channel.values[place], np.nan)


def _resampled(channel: Channel, t: np.ndarray, sample_time: float) -> np.ndarray:
    """Return the linear interpolation between samples, NaN where the channel has a gap."""
    place = np.clip(np.searchsorted(channel.t, t), 1, max(channel.t.size - 1, 1))
    steps = np.diff(channel.t, append=np.inf) if channel.t.size == 1 else np.diff(channel.t)
    gap = steps[place - 1] > 2 * max(_usual_step(channel), sample_time)
    own = np.isin(t, channel.t)
    return np.where(gap & ~own, np.nan, _straight(channel, t))
