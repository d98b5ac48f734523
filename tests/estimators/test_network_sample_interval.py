"""A network steps by the sample interval of its training, across gaps and in slower tables too."""

import warnings
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from test_pgnnl import CART, HARDENING, OneLayer, quick, rms

from sklearn_pgnn import PGNNLRegressor, effects, make_pgnn_pipeline, network
from sklearn_pgnn.estimators.network import sample_interval
from sklearn_pgnn.estimators.network.sample_interval import fill
from sklearn_pgnn.exceptions import OptionError, RecordError, RecordWarning
from sklearn_pgnn.export import to_c
from sklearn_pgnn.trajectories import read_records

STEP, EVERY = 0.02, 4


def held_records(n_records=4, n=160, seed=0, step=STEP):
    """Return records whose input changes at every twentieth sample only."""
    rng = np.random.default_rng(seed)
    tables, outputs = [], []
    for i in range(n_records):
        t = np.arange(n) * step
        force = np.repeat(rng.normal(size=n // 20) * 6, 20)
        start = rng.normal(size=2) * 0.05
        y = HARDENING.simulate(t, force, start, substeps=4).y[:, 0]
        table = {"trajectory": i, "t": t, "force": force, "x": start[0], "v": start[1]}
        tables.append(pd.DataFrame(table))
        outputs.append(y)
    return pd.concat(tables, ignore_index=True), np.concatenate(outputs)


X, Y = held_records()
#: rows of a table sampled four times as slowly, and those in a gap over which the input is held
SLOW = np.arange(len(X)) % EVERY == 0
HOLE = ((X["t"] > 0.8 + STEP / 2) & (X["t"] < 1.2 - STEP / 2)).to_numpy()


@pytest.fixture(scope="module", params=["output", "increment", "correction"])
def net(request):
    return quick(structure=request.param).fit(X, Y)


@pytest.mark.parametrize("rows", [SLOW, ~HOLE], ids=["slower", "gap"])
def test_rows_left_out_change_no_prediction(net, rows):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        few, states = net.predict(X[rows]), net.predict_states(X[rows])
    assert few == pytest.approx(net.predict(X)[rows], rel=1e-9, abs=1e-12)
    assert states == pytest.approx(net.predict_states(X)[rows], rel=1e-9, abs=1e-12)


def test_a_gap_is_crossed_ahead(net):
    found = net.predict_ahead(X[~HOLE], Y[~HOLE], steps=2)
    assert rms(found - Y[~HOLE]) < 2 * rms(net.predict(X) - Y) + 1e-3


def test_residuals_of_a_table_with_a_gap_stand_in_its_rows():
    net = quick().fit(X, Y)
    found = net.physics_residual(X[~HOLE])
    assert np.isnan(found[:, 0]).sum() == 4
    given = net.physics_residual(X[~HOLE], net.predict_states(X[~HOLE]))
    assert np.array_equal(found, given, equal_nan=True)


@pytest.mark.parametrize("guide", ["simulation", "terms"])
def test_rows_left_out_of_a_fit_are_unmeasured_ones(guide):
    options = {"structure": "increment", "guide": guide, "substeps": 1}
    dropped = quick(**options).fit(X[~HOLE], Y[~HOLE])
    kept = quick(**options).fit(X, np.where(HOLE, np.nan, Y))
    assert dropped.predict(X) == pytest.approx(kept.predict(X), rel=1e-4, abs=1e-5)


def test_simulated_columns_go_on_across_a_gap():
    options = {"structure": "increment", "guide": "simulation", "max_epochs": 4}
    pipeline = make_pgnn_pipeline(CART, refine_max_iter=5, module__neurons=3, **options).fit(X, Y)
    whole, cut = (pipeline[:-1].transform(table) for table in (X, X[~HOLE]))
    read = pipeline[-1]._read_ready
    inside = HOLE[: len(X) // 4]
    there, between = read(whole).ready[0].simulated, read(cut).ready[0].simulated
    assert between[inside] == pytest.approx(there[inside], rel=1e-6, abs=1e-6)


def test_inputs_between_two_rows_are_straight_under_a_first_order_hold():
    table = np.array([[0.0, 0.0], [0.1, 1.0], [0.4, 4.0]])
    (record,) = read_records(CART, np.column_stack([table, np.zeros((3, 2))]))
    record = replace(record, y=np.zeros((3, 1)))
    straight, held = (fill(record, 0.1, hold) for hold in ("foh", "zoh"))
    assert straight.record.u[:, 0] == pytest.approx([0, 1, 2, 3, 4])
    assert held.record.u[:, 0].tolist() == [0, 1, 1, 1, 4]
    assert held.record.t == pytest.approx([0, 0.1, 0.2, 0.3, 0.4])
    assert np.isnan(held.record.y[:, 0]).tolist() == [False, False, True, True, False]


def test_an_even_record_is_left_as_it_is():
    (record, *_) = read_records(CART, X, Y)
    assert fill(record, STEP, "zoh").record is record


@pytest.mark.parametrize("structure", ["output", "increment"])
def test_a_faster_table_is_told(structure):
    net = quick(structure=structure).fit(X, Y)
    message = (
        rf"X: expected steps of 0\.02 s, the sample interval of the training, or multiples of it, "
        rf"for the network \(structure='{structure}'\).*trajectory '0' from row 0 on and 1 more "
        rf"are sampled otherwise, there every 0\.01 s.*Remedy: resample the records to 0\.02 s"
    )
    fast, _ = held_records(2, step=STEP / 2)
    with pytest.warns(RecordWarning, match=message):
        net.predict(fast)


def test_a_correction_holds_at_other_intervals():
    net = quick(structure="correction").fit(X, Y)
    fast, y = held_records(2, step=STEP / 2)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = net.predict(fast)
    assert rms(found - y) < 0.1 * np.std(y)


def test_a_hidden_state_goes_from_sample_to_sample():
    options = {"structure": "correction", "module": network.Recurrent, "refine": None}
    net = quick(**options).fit(X, Y)
    with pytest.warns(RecordWarning, match="a FeedForward core"):
        net.predict(held_records(2, step=STEP / 2)[0])
    assert not sample_interval.holds_at_one_interval("correction", OneLayer)


def test_a_fit_on_two_rates_is_told():
    other, y = held_records(2, step=1.3 * STEP)
    other["trajectory"] += 10
    table = pd.concat([X, other], ignore_index=True)
    with pytest.warns(RecordWarning, match=r"trajectory '10' from row 640 on and 1 more"):
        quick(structure="increment", guide=None).fit(table, np.append(Y, y))


def test_an_endless_gap_is_refused():
    net = quick(max_epochs=1, refine=None).fit(X, Y)
    late = X[X["trajectory"] == 0].assign(t=lambda rows: rows["t"] + 1e6 * (rows["t"] > 1.01))
    message = (
        r"expected at most 1000000 such steps .*trajectory '0', got 5e\+07 after row 50, a gap"
    )
    with pytest.raises(RecordError, match=message):
        net.predict(late)


# -- step by step ----------------------------------------------------------------------------------


@pytest.mark.parametrize("guide", [None, "simulation"])
@pytest.mark.parametrize("delay", [None, 0.05])
def test_a_slower_stepper_is_the_prediction(guide, delay):
    model = CART if delay is None else CART + effects.InputDelay("force", delay)
    net = quick(model, structure="increment", guide=guide).fit(X, Y)
    rows = X[SLOW & (X["trajectory"] == 0).to_numpy()]
    stepper = net.stepper(x0=rows[["x", "v"]].iloc[0], interval=EVERY * STEP)
    found = [stepper.step([force])[0] for force in rows["force"][:-1]]
    assert found == pytest.approx(net.predict(rows)[1:], rel=1e-9, abs=1e-12)


def test_a_stepper_tells_of_another_interval():
    net = quick(structure="increment").fit(X, Y)
    with pytest.warns(RecordWarning, match=r"interval: expected 0\.02 s.*got 0\.013 s.*Remedy"):
        net.stepper(interval=0.013)
    with pytest.raises(OptionError, match="interval: expected the sample interval in seconds, "):
        net.stepper(interval=0)


def test_exports_refuse_another_interval():
    net = quick(structure="increment").fit(X, Y)
    message = r"interval: expected 0\.02 s.*got 0\.04 s\. Remedy: leave it out"
    with pytest.raises(OptionError, match=message):
        to_c(net, 0.04)
    assert to_c(net, 0.0201)
    assert to_c(quick(structure="correction").fit(X, Y), 0.04)


def test_a_plain_network_crosses_gaps():
    net = PGNNLRegressor(states=["x", "v"], max_epochs=4, refine_max_iter=5, module__neurons=3)
    net.fit(X, Y)
    found = net.predict(X[~HOLE])
    assert found == pytest.approx(net.predict(X)[~HOLE], rel=1e-9, abs=1e-12)
