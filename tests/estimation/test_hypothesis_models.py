"""Models of hypotheses: causes act where they can, on what those before them make."""

import pytest
import sympy

from sklearn_pgnn import PhysicsModel, effects
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.hypothesis import Hypothesis
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
def fitter():
    tanks = two_tanks()
    t = [0.5 * k for k in range(400)]
    u = [2.0 + (k // 40) % 2 for k in range(400)]
    y = tanks.simulate(t, u, x0=[1.0, 1.0]).y
    X = [[a, b] for a, b in zip(t, u, strict=True)]
    return HypothesisFitter(build_problem(tanks, read_records(tanks, X, y)))


@pytest.fixture(scope="module")
def models(fitter):
    return fitter.models


def test_a_cause_that_cannot_act_after_another_one_stands_before_it(models):
    overflow, closed = effects.Overflow("x1"), ClosedPipe("x1")
    with pytest.raises(ModelError, match="expected a target among"):
        models.extend(Hypothesis().plus(closed).plus(overflow))
    (placed,) = models.orders(Hypothesis().plus(closed), overflow)
    assert placed.order == (overflow, closed)
    assert isinstance(models.extend(placed), PhysicsModel)


def test_a_cause_that_can_act_at_no_place_is_lost(fitter, monkeypatch):
    overflow, ground = effects.Overflow("x1"), fitter.subsample(fitter.base())
    assert fitter.first_fit(ground, overflow).fit.usable
    monkeypatch.setattr(fitter.models, "is_possible", lambda hypothesis: False)
    assert fitter.models.orders(Hypothesis(), overflow) == []
    lost = fitter.first_fit(ground, overflow)
    assert lost.hypothesis.causes == (overflow,)
    assert not lost.fit.usable
