"""The course of a diagnosis: which candidates are looked at, and in what integration steps."""

import numpy as np
import pandas as pd
import pytest
from servo import SERVO, STEP, follow_steps

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, effects
from sklearn_pgnn.diagnosis import investigation

FAN = PhysicsModel({"v": "rad/s"}, {"v": "(K*u - v)/T"}, {"K": 2.0, "T": 0.3}, {"u": "V"})
DRY = effects.CoulombFriction("v", level=3.0)


def spin(least):
    """Return a record of a fan with dry friction, at voltages from the least on."""
    rng, t = np.random.default_rng(0), 0.01 * np.arange(1500)
    u = np.repeat(rng.uniform(least, 8.0, size=15), 100)
    y = (FAN + DRY).simulate(t, u, [0.0]).y[:, 0] + 0.02 * rng.normal(size=t.size)
    return pd.DataFrame({"t": t, "u": u}), y


@pytest.mark.parametrize(
    ("least", "catalogue", "looked_at"),
    [
        (2.0, ("coulomb_friction", "asymmetric_friction"), {"coulomb_friction"}),
        (-8.0, ("coulomb_friction", "asymmetric_friction"), None),
        (2.0, ("asymmetric_friction",), None),
    ],
)
def test_what_records_cannot_tell_from_a_special_case_is_not_looked_at(least, catalogue, looked_at):
    diagnosis = ModelDiagnosis(FAN, catalogue=catalogue).fit(*spin(least))
    assert {tried.effect for tried in diagnosis.candidates_} == (looked_at or set(catalogue))
    assert diagnosis.verdict_ == "cause_named"


@pytest.mark.slow
def test_steps_are_so_fine_as_the_retuned_prior_needs_not_only_the_prior():
    """A servo that is far quicker than its model thinks: a coarse step over it is another lag."""
    true, guessed = 0.6 * STEP, 10 * STEP
    slow = SERVO.replace(parameters={"G": 1.0, "T": {"value": guessed, "spread": np.inf}})
    found = ModelDiagnosis(slow).fit(*follow_steps(slow.with_parameters(T=true)))
    assert (found.verdict_, found.causes_) == ("model_adequate", ())
    assert found.substeps_ > 1
    retuned = found.parameters_["T"]
    assert retuned.low <= true <= retuned.high


@pytest.mark.parametrize("told", [None, 1])
def test_where_nothing_is_found_but_the_steps_matter_it_is_searched_again(monkeypatch, told):
    searched = []
    search = investigation.Investigation._search

    def counted(self, fitter):
        searched.append(fitter.problem.windows.substeps)
        return search(self, fitter)

    monkeypatch.setattr(investigation.Investigation, "_search", counted)
    monkeypatch.setattr(investigation, "fine_substeps", lambda fitter, trial: 4)
    X, y = follow_steps(SERVO)
    found = ModelDiagnosis(SERVO, catalogue=("input_bias",), substeps=told).fit(X, y)
    assert found.verdict_ == "model_adequate"
    assert found.substeps_ == (told or 4)
    assert searched[1:] == ([] if told else [4])
