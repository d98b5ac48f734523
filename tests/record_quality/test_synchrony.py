"""Outputs that lead their inputs, and a model that only fits better if they do."""

import numpy as np
import pandas as pd
from servo import SERVO, STEP, follow_sines

from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.problem import build_problem, with_hold
from sklearn_pgnn.record_quality.improvement import is_better
from sklearn_pgnn.record_quality.synchrony import _best_lead, find_early_output
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
    X, y = follow_sines()
    model = SERVO.with_parameters(T=0.004)
    for _, rows in X.groupby("trajectory"):
        run = model.simulate(rows["t"].to_numpy(), rows["command"].to_numpy(), substeps=4)
        smooth = y.loc[rows.index, "w"].rolling(9, center=True, min_periods=1).mean()
        y.loc[rows.index, "w"] += run.y[:, 0] - smooth
    y["w"] = y["w"].shift(-5).ffill()
    problem, base = retuned(0.004, X, y)
    finding = find_early_output(problem, base, base)
    assert finding.text.startswith("the outputs lead the inputs by 5 samples")


def test_a_command_that_is_written_down_one_sample_late_is_told():
    """Straight in between, it is half a sample late: nearer, but not noise."""
    t, rng = STEP * np.arange(1000), np.random.default_rng(0)
    tables, speeds = [], []
    for record in range(4):
        command = np.repeat(rng.uniform(-2, 2, 100), 10)
        run = SERVO.simulate(t, command, substeps=4)
        speeds.append(run.y[:, 0] + 0.01 * rng.normal(size=t.size))
        written = np.concatenate([command[:1], command[:-1]])
        tables.append(pd.DataFrame({"trajectory": record, "t": t, "command": written}))
    X, y = pd.concat(tables, ignore_index=True), pd.DataFrame({"w": np.concatenate(speeds)})
    problem = with_hold(build_problem(SERVO, read_records(SERVO, X, y)), "foh")
    base = HypothesisFitter(problem).base().fit
    finding = find_early_output(problem, base, base)
    assert finding.text.startswith("the outputs lead the inputs by 1 sample (0.002 s)")
