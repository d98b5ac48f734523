"""Long records: a search works on some of their stretches, and what it accepts is judged on all."""

import numpy as np
import pandas as pd
import pytest
from sledge import NOISE, SLEDGE, STEP, drive

from sklearn_pgnn import ModelDiagnosis, effects
from sklearn_pgnn.estimation import stretches
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.estimation.stretches import is_long, on_stretches, telling_stretches
from sklearn_pgnn.trajectories import read_records

LEVEL, BUDGET = 0.4, 2400
OPTIONS = {"hold": "zoh", "noise_std": [NOISE], "substeps": 5}


@pytest.fixture
def small_budget(monkeypatch):
    monkeypatch.setattr(stretches, "LONG", BUDGET)


def bumped(samples=9600, bump=slice(7000, 7400)):
    """Return the records of a sledge that an unrecorded force pushes for a short time."""
    X, y = drive(n_records=1, samples=samples, noise=NOISE)
    y.iloc[bump, 0] += 0.3 * np.sin(np.arange(400) * STEP)
    return read_records(SLEDGE, X, y)


def test_stretches_are_a_part_of_the_records_and_hold_what_the_prior_cannot_follow(small_budget):
    records = bumped()
    problem = build_problem(SLEDGE, records, **OPTIONS)
    assert is_long(problem)
    found, factor = telling_stretches(problem, records)
    assert BUDGET * 0.75 < sum(stretch.t.size for stretch in found) <= BUDGET
    rows = np.concatenate([stretch.rows for stretch in found])
    assert np.all(np.diff(rows) > 0)
    assert np.isin(np.arange(7000, 7400, factor), rows).mean() > 0.9
    assert rows.min() < 4000  # others are spread over the records
    for stretch in found:
        np.testing.assert_array_equal(stretch.t, records[0].t[stretch.rows])
        np.testing.assert_array_equal(stretch.y, records[0].y[stretch.rows])


@pytest.mark.parametrize("sizes", [(9600,), (3001, 2999, 3607), (700,) * 12, (401, 9000)])
def test_the_stretches_of_a_long_problem_are_not_long(small_budget, sizes):
    tables = [drive(n_records=1, samples=size, noise=NOISE) for size in sizes]
    X = pd.concat([X.assign(trajectory=number) for number, (X, _) in enumerate(tables)])
    records = read_records(SLEDGE, X, pd.concat([y for _, y in tables]))
    whole = build_problem(SLEDGE, records, **OPTIONS)
    problem, _ = on_stretches(whole, records, OPTIONS)
    assert is_long(whole)
    assert not is_long(problem)


def test_short_records_are_whole(small_budget):
    records = read_records(SLEDGE, *drive(n_records=2, samples=500))
    assert not is_long(build_problem(SLEDGE, records, **OPTIONS))


def test_thinned_inputs_are_the_mean_of_what_was_held(small_budget):
    (record,) = read_records(SLEDGE, *drive(n_records=1, samples=103))
    thinned = stretches._thin(record, 4, "zoh")
    np.testing.assert_allclose(thinned.u[:25, 0], record.u[:100, 0].reshape(25, 4).mean(axis=1))
    assert thinned.u[25, 0] == pytest.approx(record.u[100:, 0].mean())
    np.testing.assert_array_equal(stretches._thin(record, 4, "foh").u, record.u[::4])


def test_the_noise_of_all_records_is_that_of_the_stretches(small_budget):
    records = bumped()
    whole = build_problem(SLEDGE, records, **OPTIONS)
    problem, found = on_stretches(whole, records, {**OPTIONS, "window_length": None})
    np.testing.assert_array_equal(problem.windows.scale, whole.windows.scale)
    assert problem.windows.bounds.size == len(found) + 1
    assert problem.windows.lengths.sum() < whole.windows.lengths.sum() / 2


KINDS = (effects.ConstantLoad, effects.CoulombFriction, effects.QuadraticDrag)


@pytest.mark.slow
def test_what_is_found_on_stretches_is_judged_on_all_records(small_budget):
    X, y = drive(SLEDGE + effects.CoulombFriction("v", level=LEVEL), n_records=3, samples=2000)
    diagnosis = ModelDiagnosis(SLEDGE, catalogue=KINDS).fit(X, y)
    assert (diagnosis.verdict_, diagnosis.complete_) == ("cause_named", True)
    (cause,) = diagnosis.causes_
    assert (cause.effect, cause.target) == ("coulomb_friction", "v")
    level = cause.parameters["level"]
    assert level.low <= LEVEL <= level.high
    assert diagnosis.records_.windows.t.size == len(X)
    assert len(diagnosis.records_.names) == 3
    whole = ModelDiagnosis(SLEDGE, catalogue=KINDS, window_length=diagnosis.window_)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stretches, "LONG", 10 * BUDGET)
        (same,) = whole.fit(X, y).causes_
    assert level.value == pytest.approx(same.parameters["level"].value, rel=1e-3)
    assert level.high - level.low == pytest.approx(
        same.parameters["level"].high - same.parameters["level"].low, rel=0.1
    )


def test_a_time_limit_leaves_a_result_on_all_records(small_budget):
    X, y = drive(SLEDGE + effects.CoulombFriction("v", level=LEVEL), n_records=3, samples=2000)
    diagnosis = ModelDiagnosis(SLEDGE, catalogue=KINDS, time_limit=1e-6).fit(X, y)
    assert not diagnosis.complete_
    assert "time limit" in diagnosis.stopped_
    assert diagnosis.records_.windows.t.size == len(X)
    assert pd.notna(diagnosis.gain_["v"].extended)


@pytest.mark.parametrize("told_by", ["model", "option"])
def test_thinned_stretches_have_the_steps_that_the_user_gives(small_budget, monkeypatch, told_by):
    monkeypatch.setattr(stretches, "MIN_WINDOWS", 60)
    model = SLEDGE.replace(simulation={"substeps": 2}) if told_by == "model" else SLEDGE
    options = {"hold": "zoh", **({} if told_by == "model" else {"substeps": 2})}
    records = read_records(model, *drive(n_records=1, samples=9600, noise=NOISE))
    whole = build_problem(model, records, **options)
    problem, _ = on_stretches(whole, records, options)
    thinned = problem.scales.sample_time / whole.scales.sample_time
    assert thinned > 1.5
    assert problem.windows.substeps == pytest.approx(2 * thinned)


@pytest.mark.slow
def test_all_records_are_judged_with_the_steps_that_the_user_gives(small_budget, monkeypatch):
    monkeypatch.setattr(stretches, "MIN_WINDOWS", 60)
    X, y = drive(n_records=3, samples=2000)
    assert ModelDiagnosis(SLEDGE, catalogue=KINDS, substeps=2).fit(X, y).substeps_ == 2
