"""The depth that is chosen is the shallowest that is about as good as the best."""

import numpy as np
import pytest

from sklearn_pgnn.grey_box.cross_validation import FoldResult, JudgedDepths

pytestmark = pytest.mark.core


def judged(**errors):
    folds = {
        depth: [FoldResult(None, [error], np.array([[2 * error], [error]]))]
        for depth, error in errors.items()
    }
    return JudgedDepths(folds, base="fitted")


@pytest.mark.parametrize(
    ("least_gain", "depth"), [(0.0, "extended"), (0.01, "fitted"), (10.0, "prior")]
)
def test_a_deeper_model_must_gain_enough(least_gain, depth):
    assert judged(prior=1.0, fitted=0.1005, extended=0.1).choose(least_gain) == depth


def test_errors_are_means_over_folds_and_the_magnitudes_left_are_sorted():
    found = judged(prior=1.0, fitted=0.5)
    assert found.errors == pytest.approx({"prior": 1.0, "fitted": 0.5})
    assert found.left("fitted").tolist() == [[0.5], [1.0]]
