"""How large the signals of a record are."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace


@dataclass(frozen=True)
class Scales:
    """How large the signals of a record are; effects take their start values from it.

    Parameters
    ----------
    typical, peak : mapping of str to float
        Root mean square about the mean, and largest magnitude, of every state, input and output.
    rate : mapping of str to float
        Root mean square of every state's rate of change [unit of the state per second].
    sample_time : float
        Median time between samples [s].
    window : float
        Length of the windows the model is judged on [s].
    duration : float, default=inf
        Length of the longest record [s].
    latest : float, default=inf
        Largest time of a record [s]: more than `duration` behind a gap, or where a model's own
        equations contain the time and its records begin late.
    tones, ripples : mapping of str to tuple of float
        For velocities, frequencies [Hz] and periods in position that stand out in what the model
        lacks of their rate; frequencies in what it leaves of the outputs, too.
    extremes : mapping of str to tuple of float
        Least and largest value of states, inputs and outputs; without it, the magnitude both ways.
    """

    typical: Mapping[str, float]
    peak: Mapping[str, float]
    rate: Mapping[str, float]
    sample_time: float
    window: float
    duration: float = math.inf
    latest: float = math.inf
    tones: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    ripples: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    extremes: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def ends(self, name: str, below: float = 0.0, above: float = 0.0) -> tuple[float, float]:
        """Return a signal's range, the ends moved inwards by shares of it.

        Parameters
        ----------
        name : str
            The signal.
        below, above : float, default=0
            Shares.

        Returns
        -------
        tuple of float
            Lower and upper end.

        Examples
        --------
        >>> scales = Scales({}, {"y": 2.0}, {}, 0.01, 1.0)
        >>> scales.ends("y"), scales.ends("y", below=0.25)
        ((-2.0, 2.0), (-1.0, 2.0))
        """
        low, high = self.extremes.get(name, (-self.peak.get(name, 0.0), self.peak.get(name, 0.0)))
        return low + below * (high - low), high - above * (high - low)

    def of_either_sign(self, names: Iterable[str]) -> "Scales":
        """Return the scales where only the magnitude of some signals was seen.

        Parameters
        ----------
        names : iterable of str
            The signals; they may have been as far on the other side of zero.

        Returns
        -------
        Scales
            With ranges that are symmetric for these.

        Examples
        --------
        >>> seen = Scales({}, {"x": 2.0}, {}, 0.01, 1.0, extremes={"x": (0.0, 2.0)})
        >>> seen.of_either_sign(["x"]).ends("x")
        (-2.0, 2.0)
        """
        ranges = {name: (-self.peak[name], self.peak[name]) for name in names}
        return replace(self, extremes={**self.extremes, **ranges}) if ranges else self
