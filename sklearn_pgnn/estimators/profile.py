r"""The interval of a parameter that the records hardly determine, by its profile.

A standard error is the curvature at one value. Where other values far away fit as well, as those of
a time constant much shorter than a sample, it says nothing; the interval is then

.. math:: \{\theta : \min_{\text{others}} F(\theta) - F_{\min} \le 3.84\, d\}

with the objective :math:`F` and the factor :math:`d`, at least 1, by which residuals that are not
white raise the variance of the parameter.
"""

from dataclasses import replace

import numpy as np

from sklearn_pgnn.estimators.parameter_search import ParameterFit
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.substeps import IMPLICIT, MAX_SUBSTEPS
from sklearn_pgnn.simulation.uncertainty import curvatures
from sklearn_pgnn.simulation.window_fit import WindowFit, fit_windows

#: rise of the objective at the ends of a 95 % interval
RISE = 3.84
#: factor from one value to the next, most of them, and halvings of the last stretch
FACTOR, MOST, HALVINGS = 3.0, 24, 4
#: fewest integration steps from sample to sample
LEAST = 8


class Profile:
    """The objective over the values of one parameter, the others fitted anew at each.

    Steps are stable whatever the value is.
    """

    def __init__(self, found: ParameterFit, name: str, error: float):
        self.found, self.name = found, name
        windows = found.windowed.windows
        substeps = min(MAX_SUBSTEPS, max(LEAST, 2 * windows.substeps))
        self.windows = replace(windows, method=IMPLICIT, substeps=substeps)
        self.freedom = next(each for each in found.fit.freedoms if each.name == name)
        self.start = found.fit.model.parameters[name].value
        self.here = self._fit(found.fit.model, self.start)
        curvature = curvatures(found.fit, found.expected, found.spread)[name]
        self.limit = self.here.objective + RISE * max(1.0, error**2 * curvature)

    def _fit(self, model: PhysicsModel, value: float) -> WindowFit:
        others = tuple(each for each in self.found.fit.freedoms if each.name != self.name)
        return fit_windows(
            model.with_parameters(**{self.name: value}),
            self.windows,
            others,
            self.found.expected,
            self.found.spread,
            x0_start=self.found.fit.x0,
            max_steps=10,
            tolerance=1e-6,
        )

    def interval(self) -> tuple[float, float]:
        """Return the ends of the interval; that at a bound, or infinite, where it is open."""
        return self._end(-1), self._end(1)

    def _end(self, direction: int) -> float:
        bound = self.freedom.high if direction > 0 else self.freedom.low
        inside, fit = self.start, self.here
        for step in range(MOST):
            if inside == bound:
                return bound
            value = self._next(inside, step, direction, bound)
            tried = self._fit(fit.model, value)
            if not tried.objective <= self.limit:
                return self._between(inside, value, fit.model)
            inside, fit = value, tried
        return bound

    def _next(self, value: float, step: int, direction: int, bound: float) -> float:
        """Return the next value on the way to a bound: a factor away, else by growing steps."""
        if self.freedom.low >= 0 and value > 0:
            further = value * FACTOR**direction
        else:
            further = value + direction * self.freedom.scale * 2.0 ** (step - 1)
        return min(further, bound) if direction > 0 else max(further, bound)

    def _between(self, inside: float, outside: float, model: PhysicsModel) -> float:
        for _ in range(HALVINGS):
            if self.freedom.low >= 0 and min(inside, outside) > 0:
                middle = float(np.sqrt(inside * outside))
            else:
                middle = 0.5 * (inside + outside)
            if self._fit(model, middle).objective <= self.limit:
                inside = middle
            else:
                outside = middle
        return outside
