"""What is said of the parameters that were re-tuned."""

from rubbing_sledge import fresh_fitter
from sledge import SLEDGE

from sklearn_pgnn.diagnosis.result import retuned_parameters


def test_a_parameter_that_was_held_may_be_anywhere_in_its_bounds():
    """A cause stands in its place: the records say nothing of it, and it has not changed."""
    fitter = fresh_fitter()
    fit = fitter.base().fit
    table = retuned_parameters(fitter.problem, fit, {"m": 0.1})
    value, bounds = fit.model.parameters["m"].value, SLEDGE.parameters["d"].bounds
    assert table["m"].low < value < table["m"].high
    assert (table["d"].low, table["d"].high, table["d"].changed) == (*bounds, False)
