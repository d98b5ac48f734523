"""The models of hypotheses: the prior extended by causes, and its free parameters."""

import itertools

from sklearn_pgnn.estimation.freedoms import freedoms, held_by
from sklearn_pgnn.estimation.hypothesis import Hypothesis, commute, sensors_last
from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.estimation.same_in_equations import held_parameters
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.state_estimate import unsigned_states
from sklearn_pgnn.simulation.window_fit import ParameterPrior

#: causes, and the pairs of them whose order matters
Key = tuple[frozenset, frozenset]


class HypothesisModels:
    """The models of hypotheses about a prior."""

    def __init__(self, problem: EstimationProblem):
        self.problem = problem
        self._held: dict[Effect, tuple[str, ...]] = {}
        self._commuting: dict[frozenset, bool] = {}
        self._equations: dict[tuple[Effect, ...], PhysicsModel | None] = {(): problem.prior}
        self._begun: dict[tuple[Effect, ...], PhysicsModel] = {(): problem.prior}

    def key(self, hypothesis: Hypothesis) -> Key:
        """Return the identity of a hypothesis: its causes, and their order where it matters."""
        pairs = itertools.combinations(hypothesis.order, 2)
        ordered = frozenset(pair for pair in pairs if not self._commute(frozenset(pair)))
        return frozenset(hypothesis.causes), ordered

    def _commute(self, pair: frozenset) -> bool:
        if pair not in self._commuting:
            self._commuting[pair] = commute(self.problem.prior, *pair)
        return self._commuting[pair]

    def orders(self, hypothesis: Hypothesis, cause: Effect) -> list[Hypothesis]:
        """Return a hypothesis with one more cause at every position that gives another model."""
        found: dict[Key, Hypothesis] = {}
        for at in reversed(range(len(hypothesis.order) + 1)):
            placed = hypothesis.plus(cause, at)
            if self.is_possible(placed):
                found.setdefault(self.key(placed), placed)
        return list(found.values())

    def is_possible(self, hypothesis: Hypothesis) -> bool:
        """Return whether every cause can act on the model with those before it."""
        return self._with_equations_of(self._applied(hypothesis)) is not None

    def _applied(self, hypothesis: Hypothesis) -> tuple[Effect, ...]:
        return sensors_last(self.problem.prior, hypothesis.order)

    def _with_equations_of(self, causes: tuple[Effect, ...]) -> PhysicsModel | None:
        """Return the prior extended by causes; None if one of them cannot act."""
        if causes not in self._equations:
            before, last = self._with_equations_of(causes[:-1]), causes[-1]
            self._equations[causes] = None
            if before is not None and last.can_act(last.target, before):
                self._equations[causes] = last.apply(before)
        return self._equations[causes]

    def held(self, cause: Effect) -> tuple[str, ...]:
        """Return the names of the prior's parameters that a cause covers."""
        if cause not in self._held:
            self._held[cause] = held_parameters(self.problem.prior, cause)
        return self._held[cause]

    def extend(self, hypothesis: Hypothesis, values_of: PhysicsModel | None = None) -> PhysicsModel:
        """Return the prior extended by the causes of a hypothesis."""
        model = self._at_first_starts(self._applied(hypothesis))
        values = {} if values_of is None else values_of.parameters
        known = {name: p.value for name, p in values.items() if name in model.parameters}
        return model.with_parameters(**known)

    def _at_first_starts(self, causes: tuple[Effect, ...]) -> PhysicsModel:
        if causes not in self._begun:
            before = self._at_first_starts(causes[:-1])
            scales = self.problem.scales.of_either_sign(unsigned_states(before))
            first = causes[-1].proposals(before, scales)[0]
            self._begun[causes] = first.apply(before)
        return self._begun[causes]

    def free(
        self, hypothesis: Hypothesis, model: PhysicsModel
    ) -> tuple[PhysicsModel, tuple[ParameterPrior, ...]]:
        """Return a hypothesis' model with its fixed parameters, and the free ones."""
        prior = self.problem.prior
        held = held_by(prior, hypothesis, lambda _, cause: self.held(cause))
        model = model.with_parameters(**{name: prior.parameters[name].value for name in held})
        return model, freedoms(self.problem, hypothesis, model, held)
