"""Outputs that lead their inputs, and a model that only fits better if they do."""

from servo import SERVO, follow_sines, follow_steps

from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.problem import build_problem, with_hold
from sklearn_pgnn.record_quality.refits import _best_lead, find_early_output, is_better
from sklearn_pgnn.trajectories import read_records


def retuned(time_constant, X, y):
    """Return a problem with a servo's records, and its prior with this time constant, re-tuned."""
    fixed = {"value": time_constant, "fixed": True}
    prior = SERVO.replace(parameters={"G": {"value": 1.0, "spread": 0.5}, "T": fixed})
    problem = build_problem(prior, read_records(prior, X, y), window_length=1.67)
    return problem, HypothesisFitter(problem).base().fit


def test_a_late_servo_leads_no_input_though_a_model_that_is_too_slow_fits_better_so():
    problem, base = retuned(0.05, *follow_sines())
    lead, best = _best_lead(problem, base, problem.windows)
    assert lead >= 2
    assert is_better(base, best, 1)
    assert find_early_output(problem, base, base) is None


def test_a_servo_as_the_model_says_that_leads_is_told():
    X, y = follow_steps(SERVO, samples=1000)
    ahead = y.groupby(X["trajectory"])["w"].shift(-5).ffill()
    problem, base = retuned(0.005, X, ahead.to_frame())
    finding = find_early_output(problem, base, base)
    assert finding.text.startswith("the outputs lead the inputs by 5 samples")


def test_a_command_that_is_written_down_one_sample_late_is_told():
    """Straight in between, it is half a sample late: nearer, but not noise."""
    X, y = follow_steps(SERVO, samples=1000)
    X["command"] = X.groupby("trajectory")["command"].shift(1).bfill()
    problem = with_hold(build_problem(SERVO, read_records(SERVO, X, y)), "foh")
    base = HypothesisFitter(problem).base().fit
    finding = find_early_output(problem, base, base)
    assert finding.text.startswith("the outputs lead the inputs by 1 sample (0.002 s)")
