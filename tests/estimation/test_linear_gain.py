"""Laws of the first-order gain: it is that of a fit where a candidate acts linearly."""

import numpy as np
import pytest
from sledge import NOISE, SLEDGE, drive

from sklearn_pgnn import effects
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.linear_gain import LinearGain
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.trajectories import read_records


def gains(rig, kinds):
    """Return a fitter, the re-tuned prior on its first samples, and what candidates leave."""
    fitter = HypothesisFitter(build_problem(SLEDGE, read_records(SLEDGE, *drive(rig))))
    ground = fitter.subsample(fitter.base())
    candidates = [kind(target) for kind in kinds for target in kind.targets(SLEDGE)]
    gain = LinearGain(fitter.models, fitter.scales, ground)
    return fitter, ground, gain.left(fitter.windows_of(ground.fit.model), candidates)


@pytest.mark.parametrize(
    "hidden",
    [
        effects.ConstantLoad("v", load=0.05),
        effects.CoulombFriction("v", level=0.02),
        effects.QuadraticDrag("v", coefficient=0.02),
        effects.SensorBias("v", bias=10 * NOISE),
    ],
    ids=lambda effect: effect.id,
)
def test_what_is_small_leaves_what_its_fit_leaves(hidden):
    fitter, ground, left = gains(SLEDGE + hidden, (type(hidden),))
    (cause,) = left
    fit = fitter.converge(fitter.first_fit(ground, cause))
    assert left[cause].share * ground.squares == pytest.approx(fit.squares, rel=0.02)
    assert fit.squares < ground.squares


def test_squares_by_window_and_output_are_those_of_the_hypothesis_and_never_rise():
    _, ground, left = gains(SLEDGE + effects.CoulombFriction("v", level=0.4), effects.CATALOGUE)
    assert len(left) > 10
    for each in left.values():
        assert each.after.sum() <= each.before.sum() * (1 + 1e-9)
        assert (each.after >= 0.0).all()
        assert each.before.sum() <= ground.squares * (1 + 1e-9)
        assert each.before.shape == (len(ground.fit.evaluation.squares), 1)


@pytest.mark.parametrize("seed", range(4))
def test_a_hidden_cause_is_among_the_first(seed):
    rng = np.random.default_rng(seed)
    hidden = rng.choice(
        [
            effects.CoulombFriction("v", rng.uniform(0.1, 0.6)),
            effects.QuadraticDrag("v", rng.uniform(0.1, 0.5)),
            effects.InputDeadZone("F", rng.uniform(0.1, 0.5)),
            effects.SensorCurvature("v", rng.uniform(0.02, 0.1)),
        ]
    )
    _, _, left = gains(SLEDGE + hidden, effects.CATALOGUE)
    ranked = sorted(left, key=lambda cause: left[cause].share)
    place = next(i for i, cause in enumerate(ranked) if type(cause) is type(hidden))
    assert place < 8
    assert left[ranked[place]].share < 4 * left[ranked[0]].share


def test_what_adds_a_state_or_a_delay_is_not_ranked():
    kinds = (effects.ActuatorLag, effects.InputDelay, effects.ConstantLoad)
    _, _, left = gains(SLEDGE, kinds)
    assert {cause.id for cause in left} == {"constant_load"}
