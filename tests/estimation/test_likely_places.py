"""Of many places those are looked at where something acts."""

import numpy as np
import pandas as pd
import pytest

from sklearn_pgnn import PhysicsModel, effects
from sklearn_pgnn.estimation.budgets import KEPT
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.likely_places import likely_places
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.physics.places import places_of
from sklearn_pgnn.trajectories import read_records

MASSES = 5


def chain():
    """Return masses on a line, each tied to the next by a spring."""
    places = range(MASSES)
    pull = {i: f"k*(q{i} - q{i - 1})" if i else "k*q0" for i in places}
    rate = {
        i: ("F - " if i == 0 else "-") + pull[i] + (f" + {pull[i + 1]}" if i + 1 < MASSES else "")
        for i in places
    }
    return PhysicsModel(
        {f"q{i}": "m" for i in places} | {f"v{i}": "m/s" for i in places},
        {f"q{i}": f"v{i}" for i in places} | {f"v{i}": f"({rate[i]} - d*v{i})/m" for i in places},
        {"m": 1.0, "k": 50.0, "d": 0.5},
        {"F": "N"},
        outputs={f"q{i}": f"q{i}" for i in places},
        inertia={f"v{i}": "m" for i in places},
    )


@pytest.mark.parametrize("at", range(MASSES))
def test_the_mass_that_rubs_is_among_them(at):
    model, rng = chain(), np.random.default_rng(at)
    t = 0.02 * np.arange(600)
    force = 10 * np.sin(3 * t) + 8 * np.sin(7.3 * t + 1)
    rig = model + effects.CoulombFriction(f"v{at}", level=0.5)
    y = rig.simulate(t, force, substeps=5).y + 1e-3 * rng.normal(size=(t.size, MASSES))
    X = pd.DataFrame({"t": t, "F": force})
    fitter = HypothesisFitter(build_problem(model, read_records(model, X, y)))
    names = places_of(model)
    assert len(names) > KEPT
    likely = likely_places(fitter.problem, fitter.base(), names)
    assert len(likely) == KEPT
    assert f"v{at}" in likely
    assert likely_places(fitter.problem, fitter.base(), names[:KEPT]) == names[:KEPT]
