r"""How likely what acts in a cause's place is outside the catalogue.

The catalogue is not complete. Where the extended model leaves more than twice the noise, something
acts that it does not hold, and a cause may stand in for that. Of what a cause removes, :math:`E`,
and what is left of the squares beyond the noise, :math:`L`, it is credited with its part only:

.. math:: P(\text{outside}) \ge \frac{L}{E + L}.

A sensor that bends, or a parameter that drifts, is a description that suits many laws of the plant.
Where an effect of the plant does as well, it comes first. Where a law of the plant without a name
explains as much, the two are equally likely: :math:`P(\text{outside}) \ge 1/2`. A law learned from
the other records misses up to half of what it would explain if it were known (dry friction, a dead
zone), so half counts as much.
"""

from collections.abc import Iterable

import numpy as np

from sklearn_pgnn.diagnosis.structure import share_of_laws
from sklearn_pgnn.estimation.budgets import MUCH
from sklearn_pgnn.estimation.fitted_hypothesis import FittedHypothesis
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.expressions import TIME
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.places import places_of

#: probability from which on something without a name is a rival
OPEN = 0.1
#: share of what a law explains that is left of it where it is learned from the other records
LEARNED = 0.5


def probability_outside(
    fitter: HypothesisFitter,
    without: FittedHypothesis,
    final: FittedHypothesis,
    cause: Effect,
    rivals: Iterable[Effect],
) -> float:
    """Return the least probability that what acts in a cause's place is outside the catalogue.

    A rival that is a name for a law of the plant speaks for all of these.
    """
    squares = [fitter.held_out(trial).windows.squares for trial in (without, final)]
    if not np.isfinite(squares).all():
        return 0.0
    removed = float((squares[0] - squares[1]).sum())
    doubt = _left(squares[1], fitter.white_squares(final), removed)
    prior = fitter.problem.prior
    places = other_places(prior, cause)
    if removed > 0.0 and all(is_stand_in(prior, each) for each in (cause, *rivals)):
        explained = share_of_laws(fitter.problem, without, places, fitter.progress.tick)
        alike = explained * float(squares[0].sum()) >= LEARNED * removed
        doubt = max(doubt, 0.5 if alike else 0.0)
    return doubt


def _left(squares: np.ndarray, white: np.ndarray, removed: float) -> float:
    """Return the part of the explainable squares that a cause does not remove, if it is much."""
    beyond = float(np.where(squares > MUCH**2 * white, squares - white, 0.0).sum())
    return beyond / (beyond + max(removed, 0.0)) if beyond > 0.0 else 0.0


def other_places(prior: PhysicsModel, cause: Effect) -> tuple[str, ...]:
    """Return the places of the plant where a law may act in the place of a sensor or of time.

    There is none for a cause that changes the rates as a function of states and inputs, nor for one
    between an input and an output, as a branch of a cell is.
    """
    plant = {*prior.states, *prior.ports, *prior.inputs} if is_stand_in(prior, cause) else ()
    return tuple(name for name in places_of(prior) if name in plant)


def is_stand_in(prior: PhysicsModel, cause: Effect) -> bool:
    """Return whether a cause of a sensor or of time may stand in for a law of the plant.

    >>> from sklearn_pgnn import effects, systems
    >>> cart = systems.cart_on_spring()
    >>> [is_stand_in(cart, e) for e in (effects.SensorBias("position"), effects.InputBias("force"))]
    [True, False]
    """
    extended = prior + cause
    changed = [name for name, rate in prior.equations.items() if rate != extended.equations[name]]
    is_timed = any(TIME in extended.equations[name].free_symbols for name in changed)
    return is_timed or (not changed and cause.target in prior.outputs)
