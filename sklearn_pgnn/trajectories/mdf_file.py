"""Automotive measurement files: MDF, versions 2 to 4."""

from functools import cached_property

import numpy as np

from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.extras import needed_by
from sklearn_pgnn.trajectories.channels import Channel, ChannelLog


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

    def _channel(self, title: str, file) -> Channel:
        group, number = self._places[title]
        signal = file.get(group=group, index=number).validate()
        values = np.asarray(signal.samples)
        if values.dtype.kind not in "biuf" or values.ndim != 1:
            raise RecordError(
                f"{self.path}: channel {title!r}: expected a number a sample, got {values.dtype} "
                f"of shape {values.shape}."
            )
        return Channel(np.asarray(signal.timestamps, dtype=float), values.astype(float))

    def _open(self):
        from asammdf import MDF

        return MDF(self.path)
