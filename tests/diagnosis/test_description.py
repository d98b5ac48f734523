"""What describes a formula: the quantities in it, and the share that they explain."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from sledge import SLEDGE, drive

from sklearn_pgnn import ModelDiagnosis, PhysicsModel
from sklearn_pgnn.diagnosis import description
from sklearn_pgnn.diagnosis.description import known_terms
from sklearn_pgnn.diagnosis.result import Tried
from sklearn_pgnn.diagnosis.unexplained import MissingPart
from sklearn_pgnn.effects import Formula
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.inspection.report.finding import next_step
from sklearn_pgnn.inspection.words import known_sentence, verdict_sentence
from sklearn_pgnn.simulation.hidden_input import HiddenInput
from sklearn_pgnn.trajectories import read_records


@pytest.mark.parametrize("short", [1, 3, 6])
def test_records_may_differ_so_much_that_most_keep_no_row(short, monkeypatch):
    X, y = drive(n_records=1 + short, samples=1200)
    kept = (X.trajectory == 0) | (X.t < 0.599)
    problem = build_problem(SLEDGE, read_records(SLEDGE, X[kept], y[kept]))
    assert np.diff(problem.windows.bounds).tolist() == [1200, *[30] * short]
    v = problem.windows.y
    hidden = HiddenInput("v", v[:, 0] ** 3, np.ones(len(v)), v)
    trial = HypothesisFitter(problem).base()
    proposal = SimpleNamespace(effect=Formula("v", ("v**3",), (1.0,)), hidden=hidden, trial=trial)
    monkeypatch.setattr(description, "SAMPLES", 20)
    assert description.describe(problem, proposal).quantities == ("v",)


BEAM = PhysicsModel(
    {"x": "m", "v": "m/s", "a": "rad", "w": "rad/s"},
    {"x": "v", "v": "k*(x*w**2 - g*sin(a))", "a": "w", "w": "(M - c*w)/J"},
    {"k": 0.7, "g": {"value": 9.81, "fixed": True}, "c": 0.1, "J": 0.02},
    {"M": "N*m"},
    {"x": "x", "a": "a"},
)


def formula(target, terms):
    return Formula(target, tuple(terms), tuple(terms.values()))


@pytest.mark.parametrize(
    ("target", "terms", "expected"),
    [
        ("v", {"x*w**2": 0.5, "sin(a)": -4.9}, [(("x*w**2", "sin(a)"), "wrong_parameter", "k")]),
        ("v", {"sin(a)": -1.0}, [(("sin(a)",), "wrong_parameter", "g")]),
        ("w", {"M": 5.0, "w": -0.5}, [(("M", "w"), "wrong_parameter", "J")]),
        ("w", {"w": -0.5}, [(("w",), "wrong_parameter", "c")]),
        ("w", {"sign(w)": -0.5}, [(("sign(w)",), "coulomb_friction", "w")]),
        ("w", {"a*M": 1.0}, []),
    ],
)
def test_terms_that_a_parameter_or_an_effect_expresses_are_named(target, terms, expected):
    found = known_terms(BEAM, formula(target, terms))
    assert [known[:3] for known in found] == expected
    assert all(known.is_parameter == (known.effect == "wrong_parameter") for known in found)


def test_terms_out_of_proportion_are_not_one_parameter():
    found = known_terms(BEAM, formula("w", {"M": 5.0, "w": 3.0}))
    assert {known.target for known in found} == {"c", "M"}


def told(target, terms, model=BEAM, **found):
    law = formula(target, terms)
    known = known_terms(model, law)
    part = MissingPart(target, (), 0.0, law, 1.0, model, np.zeros(3), known)
    nothing = {"candidates_": (), "causes_": (), "max_causes": 4, "complete_": True}
    return part, known_sentence(SimpleNamespace(model=model, **(nothing | found)), part)


def test_the_remedy_is_that_of_the_name():
    part, said = told("w", {"w": -0.5})
    assert part.has_names
    assert said == (
        "Its term acts like what has a name: w as wrong value of c. Remedy: give c a wider spread, "
        "or spread: .inf where nothing is known."
    )
    assert "let g be fitted (it is fixed in the model)" in told("v", {"sin(a)": -1.0})[1]
    part, said = told("w", {"sign(w)": -0.5, "a*M": 1.0})
    assert not part.has_names
    assert said.startswith(
        "Some of its terms act like what has a name: sign(w) as Coulomb friction"
    )
    assert "consider Coulomb friction on w (catalogue, targets)" in said
    assert told("w", {"a*M": 1.0})[1] == ""
    assert part.to_dict()["known_terms"][0]["effect"] == "coulomb_friction"


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        ({}, "The search considered Coulomb friction on w, but the evidence for it is too weak."),
        ({"complete_": False}, "Remedy: allow more time (time_limit)"),
        ({"max_causes": 0}, "Remedy: allow more causes (max_causes)"),
    ],
)
def test_an_effect_that_was_considered_is_not_told_to_be_considered(found, expected):
    tried = (Tried("coulomb_friction", "w", 0.9, 0.8, 1.0),)
    _, said = told("w", {"sign(w)": -0.5}, candidates_=tried, **found)
    assert expected in said
    assert "let the diagnosis consider" not in said


def test_what_the_search_has_tried_is_no_next_step():
    tried = (Tried("coulomb_friction", "w", 0.9, 0.8, 1.0),)
    found = {"candidates_": tried, "causes_": (), "max_causes": 4, "complete_": True}
    found |= {"data_quality_": (), "verdict_": "unexplained", "model": BEAM, "parameters_": {}}
    part, _ = told("w", {"sign(w)": -0.5})
    assert next_step(SimpleNamespace(**found, discrepancy_=part)).startswith("Find out what acts")
    said = next_step(SimpleNamespace(**(found | {"candidates_": ()}), discrepancy_=part))
    assert "Remedy: let the diagnosis consider Coulomb friction on w" in said


def test_a_parameter_of_any_spread_ends_at_its_bounds():
    c = {"value": 0.1, "bounds": [0.0, 1.0], "spread": np.inf}
    loose = BEAM.replace(parameters={**BEAM.parameters, "c": c})
    assert "Remedy: give c wider bounds." in told("w", {"w": -9.0}, loose)[1]


def test_a_parameter_wrong_by_far_more_than_its_spread_is_no_unknown_law():
    """A ball on a beam whose rolling resistance is forty times what the model says."""
    ball = PhysicsModel(
        {"x": "m", "v": "m/s"},
        {"x": "v", "v": "-k*sin(alpha) - d*v"},
        {"k": 7.0, "d": 0.02},
        {"alpha": "rad"},
        {"x": "x"},
    )
    t, rng, tables = np.arange(0, 10, 0.02), np.random.default_rng(7019), []
    for record in range(3):
        alpha = 0.12 * np.sin((1.1 + 0.3 * record) * t) + 0.08 * np.sin((2.7 + 0.4 * record) * t)
        x = ball.with_parameters(d=0.8).simulate(t, alpha, substeps=4).y[:, 0]
        x = x + 1e-3 * rng.standard_normal(t.size)
        tables.append(pd.DataFrame({"trajectory": record, "t": t, "alpha": alpha, "x": x}))
    table = pd.concat(tables, ignore_index=True)
    diagnosis = ModelDiagnosis(ball, catalogue=())
    diagnosis.fit(table[["trajectory", "t", "alpha"]], table["x"])
    assert diagnosis.verdict_ == "unexplained"
    assert diagnosis.discrepancy_.has_names
    said = verdict_sentence(diagnosis)
    assert "no cause that was considered explains" in said
    assert "v as wrong value of d. Remedy: give d a wider spread" in said
