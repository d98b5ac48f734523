"""Designed excitations: waves of an input over the length of an experiment."""

from dataclasses import dataclass

import numpy as np

from sklearn_pgnn.estimation.budgets import OCTAVES
from sklearn_pgnn.simulation.record_windows import MIN_SAMPLES

#: the name of every kind of wave
NAMES = {
    "steps": "steps with pauses",
    "ramp": "slow ramp up and down",
    "pulse": "one pulse, then a long pause",
    "sine": "sine with a period of {period:.3g} s",
    "sweep": "sweep from {low:.2g} to {high:.2g} Hz",
}


@dataclass(frozen=True)
class Wave:
    """A wave with a largest magnitude of 1.

    Its kind is ``"steps"``, ``"ramp"``, ``"pulse"``, ``"sine"`` or ``"sweep"``; `low` and `high`
    are the lowest and highest frequency [Hz] of a sine, or of a sweep.
    """

    kind: str
    low: float = 0.0
    high: float = 0.0

    def __str__(self):
        period = 1.0 / self.low if self.low else 0.0
        return NAMES[self.kind].format(period=period, low=self.low, high=self.high)

    def __call__(self, t, duration: float) -> np.ndarray:
        """Return the wave over time.

        Times [s] run from 0 to `duration`.
        """
        t = np.asarray(t, dtype=float)
        share = t / duration
        if self.kind == "steps":
            return np.array([0.0, 1.0, 0.0, -1.0, 0.0])[np.minimum((5 * share).astype(int), 4)]
        if self.kind == "ramp":
            return 1 - np.abs((4 * share + 3) % 4 - 2)
        if self.kind == "pulse":
            return np.where((share > 0.05) & (share < 0.2), 1.0, 0.0)
        if self.kind == "sine":
            return np.sin(2 * np.pi * self.low * t)
        rate = np.log(self.high / self.low)
        return np.sin(2 * np.pi * self.low * duration * np.expm1(rate * share) / rate)


def waves(period: float, duration: float, sample_time: float) -> list[Wave]:
    """Return the waves to try on a machine."""
    quickest = MIN_SAMPLES / 2 * sample_time  # the shortest period that is sampled well enough
    octaves = np.arange(2.0 * OCTAVES + 1) - OCTAVES
    periods = [p for p in (period * 2.0**octaves).tolist() if quickest <= p < duration / 2]
    low, high = 2.0**-OCTAVES / period, min(2.0**OCTAVES / period, 1 / quickest)
    sines = [Wave("sine", 1 / p, 1 / p) for p in periods]
    return [Wave("steps"), Wave("ramp"), Wave("pulse"), *sines, Wave("sweep", low, high)]
