"""Laws of fits that other processes make: a search is the same with and without them."""

import os
import signal
import threading
from dataclasses import dataclass
from typing import ClassVar

import pytest
from joblib import parallel_config
from sledge import SLEDGE, drive

from sklearn_pgnn import ModelDiagnosis, effects
from sklearn_pgnn.estimation import fits_ahead
from sklearn_pgnn.estimation.fits_ahead import FitsAhead
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.estimation.progress import Progress, TimeIsUp
from sklearn_pgnn.physics.effects import CoulombFriction
from sklearn_pgnn.trajectories import read_records

RIG = SLEDGE + effects.CoulombFriction("v", 0.4) + effects.InputDeadZone("F", 0.5)
CATALOGUE = ["coulomb_friction", "input_dead_zone", "quadratic_drag", "constant_load"]


@pytest.fixture
def batches(monkeypatch):
    """Hand over all that can be, and count it: by task, the fits of every batch."""
    monkeypatch.setattr(fits_ahead, "WORTH", -1.0)
    monkeypatch.setattr(fits_ahead, "WORTH_STARTING", -1.0)
    handed, hand_over = [], FitsAhead._hand_over

    def count(self, fitter, task, asked):
        handed.append((task.__name__, len(asked)))
        hand_over(self, fitter, task, asked)

    monkeypatch.setattr(FitsAhead, "_hand_over", count)
    return handed


def diagnose(catalogue=CATALOGUE, **options):
    return ModelDiagnosis(SLEDGE, catalogue=catalogue, **options).fit(*drive(RIG))


def told(diagnosis):
    """Return all that a diagnosis says, to the last digit."""
    return repr(diagnosis.to_dict()), diagnosis.unusable_, diagnosis.extended_model_.parameters


def fitter_on(n_processes, progress=None):
    records = read_records(SLEDGE, *drive(RIG))
    return HypothesisFitter(build_problem(SLEDGE, records, n_processes=n_processes), progress)


@pytest.mark.slow
def test_a_diagnosis_is_the_same_whoever_fits_its_hypotheses(batches):
    here = diagnose()
    assert not batches
    there = diagnose(n_jobs=2)
    assert {task for task, _ in batches} == {"fit_from_starts", "fit_and_validate"}
    assert told(there) == told(here)
    assert {cause.effect for cause in there.causes_} == {"coulomb_friction", "input_dead_zone"}


@pytest.mark.slow
def test_effects_of_ones_own_need_no_module_that_others_can_import(batches):
    @dataclass(frozen=True)
    class OwnFriction(CoulombFriction):
        id: ClassVar[str] = "own_friction"

    catalogue = [OwnFriction, *CATALOGUE[1:]]
    assert told(diagnose(catalogue, n_jobs=2)) == told(diagnose(catalogue))
    assert batches


def test_threads_are_no_other_processes(batches):
    with parallel_config(backend="threading", n_jobs=2):
        diagnose(CATALOGUE[:2])
    assert not batches


def test_what_cannot_travel_is_fitted_here(batches):
    fitter = fitter_on(2)
    fitter.problem.states.lock = threading.Lock()
    ground = fitter.subsample(fitter.base())
    causes = [effects.CoulombFriction("v"), effects.QuadraticDrag("v")]
    fitter.prepare_first_fits((ground, cause) for cause in causes)
    assert batches == [("fit_from_starts", 2)]
    alone = fitter_on(1)
    for cause in causes:
        fits = (each.first_fit(each.subsample(each.base()), cause) for each in (fitter, alone))
        assert len({fit.fit.objective for fit in fits}) == 1


def lose(fitter, *_):
    """End the process that should fit something."""
    os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.slow
def test_where_a_process_is_lost_the_search_goes_on_without_others(batches):
    ahead = FitsAhead(2)
    with pytest.warns(
        RuntimeWarning, match=r"was lost \(TerminatedWorkerError\).*Remedy: reduce n_jobs"
    ):
        ahead.make(fitter_on(2), lose, {"one": (), "other": ()})
    assert ahead.take(lose, "one") is None
    assert ahead.n_processes == 1


@pytest.mark.slow
def test_a_time_limit_ends_fits_in_other_processes_too(batches):
    fitter = fitter_on(2, Progress(time_limit=0.0))
    ground, cause = fitter.subsample(fitter.base()), effects.CoulombFriction("v")
    (order,) = fitter.models.orders(ground.hypothesis, cause)
    task, asked = HypothesisFitter.fit_from_starts, {"fit": (ground, order, cause)}
    ahead = FitsAhead(2)
    ahead._hand_over(fitter, task, asked)
    assert ahead.take(task, "fit", ground).result.fit.usable
    fitter.progress.counts = True
    with pytest.raises(TimeIsUp):
        ahead._hand_over(fitter, task, asked)
    assert ahead.take(task, "fit", ground) is None
