"""Tell whether what has neither name nor formula acts like a slow disturbance from outside."""

from typing import NamedTuple

from sklearn_pgnn.diagnosis.judge import Judge
from sklearn_pgnn.diagnosis.unexplained import channels
from sklearn_pgnn.estimation.fitting import Trial

#: share of what is left that a disturbance must explain to be spoken of, and by which two places
#: must differ: with a spring a load is an offset of the sensor
MOST, DIFFERENT = 0.5, 0.02


class Disturbance(NamedTuple):
    """Something that acts from outside and changes slowly.

    Parameters
    ----------
    target : str
        The state in whose rate it acts, or the input or output.
    share : float
        Share of the error power left above the noise that a constant would explain which is
        another one in every window; from 0 to 1.
    """

    target: str
    share: float


def find_disturbance(judge: Judge, trial: Trial) -> Disturbance | None:
    """Find where an offset in every window explains most of what a hypothesis leaves.

    Parameters
    ----------
    judge : Judge
        The judge, with its noise.
    trial : Trial
        What it accepted.

    Returns
    -------
    Disturbance or None
        The place where it explains most, rates before sensors, or nothing if that is less than
        half.
    """
    left = judge.excess(trial)
    if not left > 0:
        return None
    places = channels(judge.fitter.problem.prior)
    found = [Disturbance(place, 1.0 - _left(judge, trial, place) / left) for place in places]
    best = max(disturbance.share for disturbance in found)
    first = next(disturbance for disturbance in found if disturbance.share > best - DIFFERENT)
    return first if best > MOST else None


def _left(judge: Judge, trial: Trial, target: str) -> float:
    """Give the squares above the floor that are left with an offset in every window."""
    fit, _ = judge.fitter.with_offset(trial, target)
    by_chance = len(fit.x0) * judge.floor / judge.fitter.problem.n_samples
    return max(fit.squares + by_chance - judge.floor, 0.0)
