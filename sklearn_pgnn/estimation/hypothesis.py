"""A hypothesis: a set of effects, each with its target."""

from dataclasses import dataclass

from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.effects import WrongParameter
from sklearn_pgnn.physics.effects.outputs import OutputEffect
from sklearn_pgnn.physics.effects.wiring import Wiring
from sklearn_pgnn.physics.model import PhysicsModel


@dataclass(frozen=True)
class Hypothesis:
    """A set of missing effects by kind and target, as found, and the order in which they apply."""

    causes: tuple[Effect, ...] = ()
    order: tuple[Effect, ...] = ()

    def __post_init__(self) -> None:
        if not self.order:
            object.__setattr__(self, "order", self.causes)

    @property
    def n_parameters(self) -> int:
        """Number of parameters the causes add or free."""
        return sum(count_parameters(c) - len(self.taken_over(c)) for c in self.causes)

    @property
    def complexity(self) -> tuple[int, int]:
        """Sort key of hypotheses: fewest parameters, then a wrong parameter before a new effect."""
        parts = [cause for cause in self.causes if not isinstance(cause, WrongParameter)]
        return self.n_parameters, len(parts)

    def taken_over(self, cause: Effect) -> tuple[str, ...]:
        """Return the fields of a cause that another cause of the hypothesis already covers."""
        beside = {other.id for other in self.causes if other.target == cause.target}
        return tuple(name for id, names in cause.shared.items() if id in beside for name in names)

    def allows(self, cause: Effect) -> bool:
        """Return whether a cause may be combined with the others."""
        return cause not in self.causes and not any(
            other.id in cause.excludes or cause.id in other.excludes for other in self.causes
        )

    def plus(self, cause: Effect, at: int | None = None) -> "Hypothesis":
        """Return the hypothesis with one more cause, the last to apply or at a given position."""
        at = len(self.order) if at is None else at
        return Hypothesis((*self.causes, cause), (*self.order[:at], cause, *self.order[at:]))

    def without(self, cause: Effect) -> "Hypothesis":
        """Return the hypothesis with one cause less."""
        causes, order = (tuple(c for c in of if c != cause) for of in (self.causes, self.order))
        return Hypothesis(causes, order)

    def before(self, cause: Effect, new: Effect) -> "Hypothesis":
        """Return the hypothesis with one more cause in front of another."""
        i, j = self.causes.index(cause), self.order.index(cause)
        causes = (*self.causes[:i], new, *self.causes[i:])
        return Hypothesis(causes, (*self.order[:j], new, *self.order[j:]))


def commute(model: PhysicsModel, one: Effect, other: Effect) -> bool:
    """Return whether two causes give the same model in either order, as with two targets.

    >>> from sklearn_pgnn.physics.effects import ActuatorLag, InputDelay, InputSaturation
    >>> from sklearn_pgnn.physics.systems import cart_on_spring
    >>> cart, lag = cart_on_spring(), ActuatorLag("force")
    >>> commute(cart, lag, InputSaturation("force")), commute(cart, lag, InputDelay("force"))
    (False, True)
    """
    if one.target != other.target:
        return True
    try:
        first, second = one.apply(model), other.apply(model)
    except ModelError:  # a formula may contain a state that the other one adds
        return False
    if not (other.can_act(other.target, first) and one.can_act(one.target, second)):
        return True
    a, b = other.apply(first), one.apply(second)
    return dict(a.equations) == dict(b.equations) and dict(a.outputs) == dict(b.outputs)


def sensors_last(model: PhysicsModel, causes: tuple[Effect, ...]) -> tuple[Effect, ...]:
    """Return causes in the order in which they apply to a model some of whose outputs are rates.

    A sensor shows what all other causes make of the rate.

    >>> from sklearn_pgnn.physics.effects import CoulombFriction, SensorGain
    >>> fall = PhysicsModel({"v": "m/s"}, {"v": "F/m"}, {"m": 2.0}, {"F": "N"}, {"a": "der(v)"})
    >>> [each.id for each in sensors_last(fall, (SensorGain("a"), CoulombFriction("v")))]
    ['coulomb_friction', 'sensor_gain']
    """
    if not any(port.outputs for port in model.ports.values()):
        return causes
    return tuple(sorted(causes, key=lambda cause: isinstance(cause, OutputEffect)))


def count_parameters(cause: Effect) -> int:
    """Count the parameters a cause adds or frees; a wiring is right or wrong."""
    freed = {cause.target} if cause.revalues else set()
    return 0 if isinstance(cause, Wiring) else max(1, len(freed.union(cause.names().values())))


def resemble(problem: EstimationProblem, model: PhysicsModel, cause: Effect, other: Effect) -> bool:
    """Return whether a cause is so small that these records cannot distinguish it from another."""
    if cause.target != other.target or other.id not in cause.resembles:
        return False
    mine, its = cause.resembles[other.id]
    low, _ = other.limits(other.target, problem.prior, problem.scales)[its]
    return model.parameters[cause.names()[mine]].value < low
