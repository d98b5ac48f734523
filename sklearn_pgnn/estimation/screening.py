r"""Rank candidates, and pairs of them, by the expected sum of squared residuals.

Fitting every candidate in addition to every hypothesis would take long, and two causes may help
together where neither helps alone. To first order the candidates leave

.. math:: \min_{p, x_0, a, b} |r - S_p p - S_x x_0 - E_a a - E_b b|^2

of the residuals :math:`r` of a hypothesis, with the sensitivities :math:`S` to its parameters that
are not at a limit and to every window's initial state, and the changes of the outputs :math:`E`
that a candidate brings: as fitted with the best hypothesis so far, and by each of its own
parameters.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations

import numpy as np

from sklearn_pgnn.estimation.budgets import ROUNDING, SMALL_CHANGE
from sklearn_pgnn.estimation.fitted_hypothesis import SubsampleFit
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.window_fit import WindowFit
from sklearn_pgnn.simulation.windows import ShootingWindows, evaluate


def small_step(windows: ShootingWindows, fit: WindowFit, place: int) -> float:
    r"""Return the step of a parameter that changes the outputs by a small part of the noise.

    .. math:: h = c \left/ \sqrt{\tfrac{1}{N} \sum_k |\partial y_k / \partial \theta|^2} \right.

    with the outputs in units of the noise and :math:`c` the `SMALL_CHANGE`: it does not depend on
    the parameter's unit.
    """
    steep = np.sqrt(fit.evaluation.gram[:, place, place].sum() / windows.lengths.sum())
    return SMALL_CHANGE / steep if steep > 0 else SMALL_CHANGE * fit.freedoms[place].scale


@dataclass
class Screening:
    """The changes of the outputs by candidates, and the expected gain."""

    windows_of: Callable[[PhysicsModel], ShootingWindows]
    tick: Callable[[], bool | None] = lambda: None
    _fits: dict[Effect, tuple[SubsampleFit, SubsampleFit]] = field(default_factory=dict)
    _changes: dict[Effect, np.ndarray] = field(default_factory=dict)

    @property
    def known(self) -> frozenset[Effect]:
        """The candidates that could be fitted."""
        return frozenset(self._fits)

    def learn(self, ground: SubsampleFit, fit: SubsampleFit) -> None:
        """Store the changes by a candidate from its fit with a hypothesis.

        The best hypothesis is used: with large errors a candidate may have another effect than with
        small ones.
        """
        if not fit.fit.usable:
            return
        cause = fit.hypothesis.causes[-1]
        if cause in self._fits and self._fits[cause][0].fit.objective < ground.fit.objective:
            return
        self._fits[cause] = ground, fit
        self._changes.pop(cause, None)

    def _change_by(self, cause: Effect) -> np.ndarray:
        """Return the changes by a candidate, and by each of its parameters: a column each."""
        if cause not in self._changes:
            ground, fit = self._fits[cause]
            view, own = self._view(fit), set(cause.names().values())
            names = [freedom.name for freedom in fit.fit.freedoms if freedom.name in own]
            fitted = self._view(ground).residual - view.residual
            self._changes[cause] = np.column_stack([fitted, *map(view.slope, names)])
        return self._changes[cause]

    def _view(self, fit: SubsampleFit) -> "_View":
        return _View(self.windows_of(fit.fit.model), fit.fit, self.tick)

    def rank(self, ground: SubsampleFit, count: int = 1) -> list[tuple[float, tuple[Effect, ...]]]:
        """Rank candidates that may be added to a hypothesis, alone or several together."""
        view = self._view(ground)
        found = zip(ground.fit.freedoms, ground.fit.values, strict=True)
        tuned = [view.slope(each.name) for each, value in found if each.low < value < each.high]
        known = view.without_states(np.column_stack([view.residual, *tuned]))
        blocks = {
            cause: view.without_states(self._change_by(cause))
            for cause in self._fits
            if ground.hypothesis.allows(cause)
        }
        products, of = _Products(np.hstack([known, *blocks.values()])), {}
        end = known.shape[1]
        for cause, block in blocks.items():
            of[cause] = np.arange(end, end := end + block.shape[1])
        own = np.arange(known.shape[1])
        ranked = [
            (products.left(np.concatenate([own, *(of[cause] for cause in causes)])), causes)
            for causes in combinations(blocks, count)
        ]
        return sorted(ranked, key=lambda item: item[0])


def _basis(table: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis of columns, without rounding errors."""
    directions, sizes, _ = np.linalg.svd(table, full_matrices=False)
    return directions[:, sizes > ROUNDING * sizes[0]]


class _Products:
    """The products of columns, each scaled to length one."""

    def __init__(self, table: np.ndarray):
        size = np.linalg.norm(table, axis=0)
        table = table / np.where(size > 0, size, 1.0)
        self.square, self.gram = float(size[0] ** 2), table.T @ table

    def left(self, which: np.ndarray) -> float:
        """Return the squares of the first of some columns that the others do not explain."""
        gram = self.gram[np.ix_(which, which)]
        inverse = np.linalg.pinv(gram[1:, 1:], rcond=ROUNDING, hermitian=True)
        return self.square * float(1.0 - gram[0, 1:] @ inverse @ gram[1:, 0])


@dataclass(frozen=True)
class _View:
    """Outputs on the windows of a fit, in units of the noise and laid end to end."""

    windows: ShootingWindows
    fit: WindowFit
    tick: Callable[[], bool | None]

    @property
    def residual(self) -> np.ndarray:
        return self.flat(self.fit.evaluation.residual)

    def flat(self, values: np.ndarray) -> np.ndarray:
        return np.nan_to_num(values[self.windows.rows] / self.windows.scale).ravel()

    def change(self, model: PhysicsModel, x0: np.ndarray) -> np.ndarray:
        """Return by how much the outputs change with the model and the initial states.

        A window with a failed simulation counts as no change.
        """
        self.tick()
        wrt = tuple(freedom.name for freedom in self.fit.freedoms)
        moved = evaluate(model, self.windows, x0, wrt)
        known = np.repeat(
            np.isfinite(moved.squares), self.windows.lengths * self.windows.y.shape[1]
        )
        return np.where(known, self.flat(self.fit.evaluation.residual - moved.residual), 0.0)

    def slope(self, name: str) -> np.ndarray:
        """Return the direction in which a parameter changes the outputs, within its bounds."""
        fit = self.fit
        place = [freedom.name for freedom in fit.freedoms].index(name)
        value, step = fit.model.parameters[name].value, small_step(self.windows, fit, place)
        model = fit.model.with_parameters(**{name: fit.freedoms[place].beside(value, step)})
        return self.change(model, fit.x0)

    @cached_property
    def bases(self) -> list[np.ndarray]:
        """Return an orthonormal basis of what the initial state of each window can change."""
        fit = self.fit
        moves = 1e-3 * np.maximum(np.std(fit.x0, axis=0), 1e-6) * np.eye(fit.x0.shape[1])
        shifts = np.column_stack([self.change(fit.model, fit.x0 + move) for move in moves])
        return [_basis(part) for part in self.by_window(shifts)]

    def by_window(self, table: np.ndarray) -> list[np.ndarray]:
        ends = np.cumsum(self.windows.lengths) * self.windows.y.shape[1]
        return np.split(table, ends[:-1])

    def without_states(self, table: np.ndarray) -> np.ndarray:
        """Subtract from every column the part that the initial states explain."""
        pairs = zip(self.bases, self.by_window(table), strict=True)
        return np.concatenate([part - basis @ (basis.T @ part) for basis, part in pairs])
