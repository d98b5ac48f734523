"""Every effect of the catalogue can be tried after every other one, whatever that one added.

Effects add states (an actuator's, a hysteresis), replace inputs in outputs, hide signs and delay
inputs. The machines have feed-through, hidden states, several outputs and several inputs.
"""

from functools import cache
from itertools import permutations

import numpy as np
import pytest

from sklearn_pgnn import PhysicsModel, effects
from sklearn_pgnn.diagnosis.description import describe
from sklearn_pgnn.diagnosis.unexplained import Proposal, propose_again
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.hypothesis import Hypothesis
from sklearn_pgnn.estimation.possible_causes import possible_causes
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.estimation.starts import _at_starts
from sklearn_pgnn.physics.effects import CATALOGUE
from sklearn_pgnn.physics.effects.formula import Formula
from sklearn_pgnn.simulation.state_estimate import unsigned_states
from sklearn_pgnn.trajectories import read_records

CELL = PhysicsModel(
    {"z": ""},
    {"z": "I/Q - k*z"},
    {"Q": 40.0, "k": 0.01, "R0": 0.3, "c": 3.0},
    {"I": "A"},
    {"V": "c*z + R0*I"},
)
DRIVE = PhysicsModel(
    {"i": "A", "w": "rad/s", "phi": "rad", "T": "K"},
    {
        "i": "(u - R*i - k*w)/L",
        "w": "(k*i - d*w - M)/J",
        "phi": "w",
        "T": "(R*i**2 - h*(T - T_room))/C",
    },
    {"R": 1.0, "L": 0.1, "k": 0.5, "d": 0.1, "J": 0.05, "h": 0.5, "C": 20.0},
    {"u": "V", "M": "N*m", "T_room": "K"},
    {"angle": "phi", "power": "u*i", "speed": "w + M/100"},
    inertia={"w": "J"},
)
TANKS = PhysicsModel(
    {"h1": "m", "h2": "m"},
    {"h1": "q/A - k*sqrt(h1 + 1)", "h2": "k*sqrt(h1 + 1) - k*sqrt(h2 + 1)"},
    {"A": 2.0, "k": 0.3},
    {"q": "m^3/s"},
    {"lower": "h2", "total": "h1 + h2 + q/10"},
    initial_state={"h1": 1.0, "h2": 1.0},
)
MACHINES = {"cell": CELL, "drive": DRIVE, "tanks": TANKS}


@cache
def fitter_of(machine):
    model, t = MACHINES[machine], np.arange(0, 40, 0.1)
    inputs = [1.2 + np.sign(np.sin(0.4 * t + i)) * (i == 0) + 0.3 * i for i in range(3)]
    u = np.column_stack(inputs[: len(model.inputs)])
    y = model.simulate(t, u, substeps=4).y + 1e-3 * np.random.default_rng(0).normal(
        size=(t.size, len(model.outputs))
    )
    records = read_records(model, np.column_stack([t, u]), y)
    return HypothesisFitter(build_problem(model, records))


def pairs_on(machine):
    causes = possible_causes(MACHINES[machine], CATALOGUE)
    return [pair for pair in permutations(causes, 2) if Hypothesis(pair[:1]).allows(pair[1])]


def some(pairs, count, seed):
    return [pairs[i] for i in np.random.default_rng(seed).permutation(len(pairs))[:count]]


def begin(fitter, one, other):
    """Do all that precedes a fit of a second effect, at every position."""
    ground = fitter.subsample(fitter.base())
    for hypothesis in fitter.models.orders(Hypothesis((one,)), other):
        for model in _at_starts(fitter, ground, hypothesis, other):
            fitter.models.free(hypothesis, model)
        assert np.isfinite(fitter.problem.states.values(model)).any()


@pytest.mark.parametrize("machine", MACHINES)
def test_a_second_effect_can_be_fitted_after_a_first_one(machine):
    fitter = fitter_of(machine)
    for one, other in some(pairs_on(machine), 3, seed=1):
        first = fitter.first_fit(fitter.subsample(fitter.base()), one)
        fitter.first_fit(first, other)
    for one, other in some(pairs_on(machine), 12, seed=2):
        begin(fitter, one, other)


@pytest.mark.slow
@pytest.mark.parametrize("machine", MACHINES)
def test_every_kind_of_effect_can_begin_after_every_other_one(machine):
    """At targets that are drawn: all of them are thousands of pairs."""
    pairs = pairs_on(machine)
    of_kinds = {(type(a), type(b)): (a, b) for a, b in some(pairs, len(pairs), seed=3)}
    for one, other in of_kinds.values():
        begin(fitter_of(machine), one, other)


def test_the_sign_of_an_input_s_own_state_may_be_hidden_by_a_sensor():
    """An actuator's lag in an output with feed-through, which a rectifier then shows."""
    lag, rectified = effects.ActuatorLag("I"), effects.SensorRectification("V")
    fitter = fitter_of("cell")
    first = fitter.first_fit(fitter.subsample(fitter.base()), lag)
    assert first.fit.usable
    assert "I_lagged" in unsigned_states(rectified.apply(lag.apply(CELL)))
    assert fitter.first_fit(first, rectified).hypothesis.causes == (lag, rectified)


@pytest.mark.parametrize("cause", [effects.ActuatorLag("I"), effects.InputBacklash("I")])
@pytest.mark.parametrize("place", ["z", "I", "V"])
def test_a_formula_may_hold_a_state_that_a_cause_added(cause, place):
    fitter = fitter_of("cell")
    base = fitter.base()
    trial = fitter.fit_all(fitter.first_fit(fitter.subsample(base), cause), base)
    (added,) = set(trial.fit.model.states) - set(CELL.states)
    formula = Formula(place, ("z", added), (0.01, 0.01))
    again = propose_again(fitter.problem, trial, Proposal(None, formula, trial))
    part = describe(fitter.problem, again)
    assert added in part.quantities
    assert all(added not in named.terms for named in part.known)
    assert part.model.parameters.keys() >= set(formula.names().values())
