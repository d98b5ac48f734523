"""Magnitudes of the signals of a record, and typical values of what effects depend on."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import sympy

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.expressions import TIME, parse_expression, symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.port import inertia_at


@dataclass(frozen=True)
class Scales:
    """Magnitudes of the signals of a record, from which effects take their start values.

    Parameters
    ----------
    typical, peak : mapping of str to float
        Root mean square about the mean, and largest magnitude, of every state, input and output.
    rate : mapping of str to float
        Root mean square of every state's rate of change [unit of the state per second].
    sample_time : float
        Median time between samples [s].
    window : float
        Length of the windows on which the model is assessed [s].
    duration : float, default=inf
        Length of the longest record [s].
    latest : float, default=inf
        Largest time of a record [s]; it exceeds `duration` for a record after a gap, and where the
        model's own equations contain the time and its records begin late.
    tones, ripples : mapping of str to tuple of float
        For velocities, frequencies [Hz] and periods in position that stand out in the part of
        their rate that the model lacks; also frequencies in the residuals of the outputs.
    extremes : mapping of str to tuple of float
        Least and largest value of states, inputs and outputs; where it is missing, plus and minus
        the largest magnitude.
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
        """Return a signal's range, its ends moved inwards by fractions of the range.

        Parameters
        ----------
        name : str
            The signal.
        below, above : float, default=0
            Fractions of the range.

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

    def is_zero(self, name: str) -> bool:
        """Return whether a signal is known to be zero always, as that of an idle drive.

        Parameters
        ----------
        name : str
            The signal.

        Returns
        -------
        bool
            False where its extremes are not known.

        Examples
        --------
        >>> scales = Scales({}, {}, {}, 0.01, 1.0, extremes={"u": (0.0, 0.0), "y": (0.0, 2.0)})
        >>> scales.is_zero("u"), scales.is_zero("y")
        (True, False)
        """
        return self.extremes.get(name) == (0.0, 0.0)

    def of_either_sign(self, names: Iterable[str]) -> "Scales":
        """Return the scales if only the magnitude of some signals was measured.

        Parameters
        ----------
        names : iterable of str
            The signals; they may have gone equally far to the other side of zero. States that an
            effect has added are in no record, and have no range.

        Returns
        -------
        Scales
            The scales, with symmetric ranges for these signals.

        Examples
        --------
        >>> seen = Scales({}, {"x": 2.0}, {}, 0.01, 1.0, extremes={"x": (0.0, 2.0)})
        >>> seen.of_either_sign(["x"]).ends("x")
        (-2.0, 2.0)
        """
        ranges = {name: (-self.peak[name], self.peak[name]) for name in names if name in self.peak}
        return replace(self, extremes={**self.extremes, **ranges}) if ranges else self


def typical_by_kind(target: str, model: PhysicsModel, scales: Scales) -> dict[str, float]:
    """Return a typical value of every kind of unit that an effect may depend on."""
    scale = {"s": scales.window, "target": scales.typical.get(target, 1.0)}
    if target in model.ports:
        position = model.port(target).position
        scale["velocity"] = scales.typical[target]
        scale["force"] = scales.rate[target] * typical_inertia(target, model, scales)
        scale["position"] = scales.typical[position] if position else 1.0
    return scale


def typical_inertia(target: str, model: PhysicsModel, scales: Scales) -> float:
    """Return the inertia that an effort at a port moves, 1 where the model has none.

    >>> from sklearn_pgnn.physics.systems import golf_robot
    >>> robot = golf_robot()
    >>> typical_inertia("omega", robot, Scales({}, {}, {}, 0.01, 1.0))
    0.1445
    """
    inertia = inertia_at(model.port(target), model) if target in model.ports else sympy.Integer(1)
    known = dict(scales.typical) | {name: p.value for name, p in model.parameters.items()}
    known[str(TIME)] = 0.0
    return abs(float(inertia.subs({s: known.get(str(s), 1.0) for s in inertia.free_symbols})))


class _OneIfUnknown(dict):
    def __missing__(self, key: str) -> float:
        return 1.0


def typical_value(template: str, scale: Mapping[str, float]) -> float:
    """Return the typical value of a quantity from the template of its unit, 1 if it has none.

    >>> typical_value("{force}*s", {"force": 3.0, "s": 0.5})
    1.5
    """
    text = template.format_map(_OneIfUnknown(scale)).replace("^", "**") or "1"
    try:
        return float(parse_expression(text, ["s"]).subs(symbol("s"), scale.get("s", 1.0)))
    except ModelError:  # a unit of the effect's own
        return 1.0
