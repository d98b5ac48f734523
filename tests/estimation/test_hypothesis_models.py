"""Models of hypotheses: causes act where they can, on what those before them make."""

import pytest
import sympy

from sklearn_pgnn import PhysicsModel, effects
from sklearn_pgnn.estimation.hypothesis import Hypothesis
from sklearn_pgnn.estimation.hypothesis_models import HypothesisModels
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.systems import two_tanks
from sklearn_pgnn.trajectories import read_records


class ClosedPipe(effects.Leak):
    """The pipe to the other tank is closed: nothing flows on that could run over into it."""

    id = "closed_pipe"

    def rewrite(self, model, p):
        """Let nothing into the other tank."""
        return {"equations": {**model.equations, "x2": sympy.Integer(0)}}


@pytest.fixture(scope="module")
def models():
    tanks = two_tanks()
    t = [0.5 * k for k in range(400)]
    u = [2.0 + (k // 40) % 2 for k in range(400)]
    y = tanks.simulate(t, u, x0=[1.0, 1.0]).y
    X = [[a, b] for a, b in zip(t, u, strict=True)]
    return HypothesisModels(build_problem(tanks, read_records(tanks, X, y)))


def test_a_cause_that_cannot_act_after_another_one_stands_before_it(models):
    overflow, closed = effects.Overflow("x1"), ClosedPipe("x1")
    with pytest.raises(ModelError, match="expected a target among"):
        models.extend(Hypothesis().plus(closed).plus(overflow))
    (placed,) = models.orders(Hypothesis().plus(closed), overflow)
    assert placed.order == (overflow, closed)
    assert isinstance(models.extend(placed), PhysicsModel)
    assert models.allows(Hypothesis().plus(closed), overflow)


def test_a_cause_that_can_act_at_no_place_may_not_stand(models, monkeypatch):
    overflow, leak = effects.Overflow("x1"), effects.Leak("x1")
    assert models.allows(Hypothesis().plus(leak), overflow)
    monkeypatch.setattr(models, "is_possible", lambda hypothesis: False)
    assert models.orders(Hypothesis().plus(leak), overflow) == []
    assert not models.allows(Hypothesis().plus(leak), overflow)
