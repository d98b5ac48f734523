"""What skorch's documentation promises holds for PGNNLRegressor: callbacks, schedulers, splits."""

import numpy as np
import pandas as pd
import pytest
import torch
from sklearn.base import clone
from skorch.callbacks import (
    BatchScoring,
    Checkpoint,
    EarlyStopping,
    EpochScoring,
    GradientNormClipping,
    LRScheduler,
)
from skorch.dataset import ValidSplit
from torch.optim.lr_scheduler import CyclicLR, OneCycleLR, ReduceLROnPlateau, StepLR

from sklearn_pgnn import PGNNLRegressor, PhysicsModel
from sklearn_pgnn.network import PhysicsTerm

LAG = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 0.5}, {"u": "V"})
MACHINE = LAG.replace(equations={"y": "(u - y - 0.3*y**3)/T"})
QUICK = {"max_epochs": 6, "module__neurons": 3, "refine_max_iter": 8, "substeps": 1}


def records(n_records=4, n=80):
    frames, outputs = [], []
    for i in range(n_records):
        t = np.arange(n) * 0.05
        u = 2 * np.sin((1 + i) * t) + 0.5 * i
        frames.append(pd.DataFrame({"t": t, "u": u}))
        outputs.append(MACHINE.simulate(t, u).y[:, 0])
    return pd.concat(frames, ignore_index=True), np.concatenate(outputs)


X, Y = records()
RNG = np.random.default_rng(0)
ROWS = RNG.normal(size=(200, 3))
TARGETS = ROWS @ [1.0, -2.0, 0.5] + 0.01 * RNG.normal(size=200)


class Noting(torch.optim.SGD):
    """Notes the learning rate of every step that it really takes."""

    rates = []

    def step(self, closure=None):
        Noting.rates.append(self.param_groups[0]["lr"])
        return super().step(closure)


def rates_of(**options):
    Noting.rates = []
    net = PGNNLRegressor(LAG, optimizer=Noting, lr=0.01, **{**QUICK, **options}).fit(X, Y)
    by_epoch = np.array_split(Noting.rates, QUICK["max_epochs"])
    return net, [float(rates[0]) for rates in by_epoch]


# -- schedulers ------------------------------------------------------------------------------------


def test_a_scheduler_decides_over_the_rate_of_every_step():
    step = LRScheduler(StepLR, step_size=2, gamma=0.5)
    net, rates = rates_of(callbacks=[step])
    assert rates == pytest.approx([0.01, 0.01, 0.005, 0.005, 0.0025, 0.0025])
    noted = [row["event_lr"] for row in net.history if "event_lr" in row]
    assert noted == pytest.approx(rates)  # and none in the last phase, where no step is its


@pytest.mark.slow
def test_without_a_scheduler_the_rate_decays_by_a_cosine():
    _, rates = rates_of()
    expected = 0.01 * (1 + np.cos(np.pi * np.arange(6) / 6)) / 2
    assert rates == pytest.approx(expected)
    _, held = rates_of(callbacks__decay=None)
    assert held == pytest.approx([0.01] * 6)


def test_a_scheduler_goes_on_through_rollouts():
    step = LRScheduler(StepLR, step_size=1, gamma=0.5)
    Noting.rates = []
    options = {**QUICK, "max_epochs": 2, "horizon": 5, "rollout_epochs": 2, "refine": None}
    PGNNLRegressor(LAG, optimizer=Noting, lr=0.01, callbacks=[step], **options).fit(X, Y)
    assert sorted(set(Noting.rates), reverse=True) == pytest.approx([0.01, 0.005, 0.0025, 0.00125])


@pytest.mark.parametrize(
    "scheduler",
    [
        LRScheduler(OneCycleLR, max_lr=0.02, total_steps=6),
        LRScheduler(CyclicLR, base_lr=1e-3, max_lr=1e-2, step_every="batch"),
        LRScheduler(ReduceLROnPlateau, monitor="valid_loss", patience=0),
    ],
    ids=["one cycle", "cyclic", "plateau"],
)
def test_schedulers_of_torch(scheduler):
    net = PGNNLRegressor(LAG, callbacks=[scheduler], **QUICK)
    assert net.fit(X, Y).score(X, Y) > 0.9


# -- stopping and keeping --------------------------------------------------------------------------


def phases_of(net):
    """Return how many epochs single steps and the last phase had."""
    steps = sum("train_batch_count" in row for row in net.history)
    return steps, len(net.history) - steps


def test_early_stopping_ends_the_phase_it_belongs_to():
    stopping = EarlyStopping("train_loss", patience=2, threshold=1.0)  # nothing is good enough
    net = PGNNLRegressor(LAG, callbacks=[stopping], **{**QUICK, "max_epochs": 30}).fit(X, Y)
    steps, last = phases_of(net)
    assert steps == 3
    assert 0 < last <= 3


@pytest.mark.parametrize("load_best", [False, True])
def test_early_stopping_of_held_out_trajectories(load_best):
    net = PGNNLRegressor(LAG, callbacks=[EarlyStopping(load_best=load_best)], **QUICK).fit(X, Y)
    assert min(phases_of(net)) > 0
    assert net.free_run_error_ == pytest.approx(min(net.history[:, "free_run"]), rel=1e-9)


def test_an_interrupt_ends_all_phases():
    def interrupt(net, *_):
        raise KeyboardInterrupt

    stop = EpochScoring(interrupt, on_train=True)
    net = PGNNLRegressor(LAG, callbacks=[EarlyStopping(), stop], **QUICK).fit(X, Y)
    assert phases_of(net) == (1, 0)


@pytest.mark.slow
def test_history_holds_the_validation_loss():
    net = PGNNLRegressor(LAG, **QUICK).fit(X, Y)
    errors = np.array(net.history[:, "free_run"])
    assert np.array(net.history[:, "valid_loss"]) == pytest.approx(errors**2)
    assert net.history[:, "valid_loss_best"] == net.history[:, "free_run_best"]
    none = PGNNLRegressor(LAG, validation_fraction=0.0, **QUICK).fit(X, Y)
    assert all("valid_loss" not in row for row in none.history)


@pytest.mark.slow
def test_checkpoint_keeps_and_loads_the_best(tmp_path):
    checkpoint = Checkpoint(dirname=tmp_path, load_best=True)
    net = PGNNLRegressor(LAG, callbacks=[checkpoint], **QUICK).fit(X, Y)
    assert (tmp_path / "params.pt").exists()
    assert net.free_run_error_ == pytest.approx(min(net.history[:, "free_run"]), rel=1e-9)
    again = PGNNLRegressor(LAG, **{**QUICK, "max_epochs": 1, "refine": None}).fit(X, Y)
    again.load_params(checkpoint=checkpoint)
    assert np.array_equal(again.predict(X), net.predict(X))


# -- scores ----------------------------------------------------------------------------------------


@pytest.mark.slow
def test_scores_are_of_free_runs_of_the_tables_rows():
    seen = []

    def look(net, given, y):
        seen.append((given, y))
        return net.score(given, y)

    scores = [
        EpochScoring(look, on_train=True, name="seen", lower_is_better=False),
        EpochScoring("r2", on_train=True, name="train_r2", lower_is_better=False),
        EpochScoring("neg_mean_absolute_error", name="valid_mae", lower_is_better=False),
    ]
    net = PGNNLRegressor(LAG, callbacks=scores, validation_fraction=0.25, **QUICK).fit(X, Y)
    given, y = seen[-1]
    assert isinstance(given, pd.DataFrame)
    assert len(given) == len(y) == 240  # one of four trajectories is held out
    assert np.array_equal(Y[given.index], y)
    assert net.history[:, "train_r2"] == net.history[:, "seen"]
    held = X.index.difference(given.index)
    assert len(net.history[:, "valid_mae"]) == len(net.history)
    best = int(np.argmin(net.history[:, "free_run"]))
    expected = -np.mean(np.abs(net.predict(X.loc[held]) - Y[held]))
    assert net.history[best, "valid_mae"] == pytest.approx(expected)


def test_scores_of_batches_have_no_rows():
    with pytest.raises(ValueError, match=r"BatchScoring scores batches of rows.*Remedy: EpochSco"):
        PGNNLRegressor(LAG, callbacks=[BatchScoring("r2", on_train=True)], **QUICK).fit(X, Y)


def test_gradients_are_clipped():
    clipped = PGNNLRegressor(LAG, callbacks=[GradientNormClipping(1e-9)], **QUICK)
    clipped.set_params(optimizer=torch.optim.SGD, refine=None, validation_fraction=0.0)
    before = clone(clipped).set_params(max_epochs=0)
    expected = before.fit(X, Y).predict(X)
    assert clipped.fit(X, Y).predict(X) == pytest.approx(expected, abs=1e-6)


# -- without, and for rows -------------------------------------------------------------------------


@pytest.mark.parametrize("table", [(X, Y), (ROWS, TARGETS)], ids=["trajectories", "rows"])
def test_callbacks_may_be_disabled(table):
    model = LAG if table[0] is X else None
    net = PGNNLRegressor(model, callbacks="disable", **QUICK).fit(*table)
    assert net.callbacks_ == []
    assert net.score(*table) > 0.5
    assert "free_run" not in net.history[-1]


def test_rows_are_split_as_skorch_does():
    net = PGNNLRegressor(
        train_split=ValidSplit(5), callbacks=[EarlyStopping(patience=3)], max_epochs=40
    ).fit(ROWS, TARGETS)
    assert all(row["valid_loss"] > 0 for row in net.history)
    assert net.score(ROWS, TARGETS) > 0.9
    scores = [EpochScoring("r2", on_train=True, name="r2", lower_is_better=False)]
    scored = PGNNLRegressor(callbacks=scores, max_epochs=3).fit(ROWS, TARGETS)
    assert scored.history[-1, "r2"] == pytest.approx(scored.score(ROWS, TARGETS))


def test_trajectories_are_not_split_by_rows():
    expected = r"train_split: expected None where X has a time.*Remedy: validation_fraction=0\.2"
    with pytest.raises(ValueError, match=expected):
        PGNNLRegressor(LAG, train_split=ValidSplit(5), **QUICK).fit(X, Y)


# -- what is not finite ----------------------------------------------------------------------------


def root(x, u, t):
    return torch.sqrt(x[:, 1:, 0] - 0.5)  # NaN below 0.5 V


@pytest.mark.parametrize(
    ("options", "epoch"),
    [({}, 1), ({"max_epochs": 0}, 0), ({"max_epochs": 0, "refine": "lbfgs"}, 0)],
    ids=["single steps", "last phase", "last phase, lbfgs"],
)
@pytest.mark.parametrize("term", [root, PhysicsTerm(root), [lambda x, u, t: 0 * u[..., 0], root]])
def test_a_term_that_is_not_a_number_stops_the_training(term, options, epoch):
    net = PGNNLRegressor(LAG, physics_loss=term, lambda_phy=0.1, **{**QUICK, **options})
    expected = rf"stopped in epoch {epoch}: physics_loss: root is not finite.*Remedy: keep roots"
    with pytest.raises(ValueError, match=expected):
        net.fit(X, Y)


def test_weights_that_left_the_numbers_stop_the_training():
    net = PGNNLRegressor(LAG, optimizer=torch.optim.SGD, lr=1e200, **QUICK)
    net.set_params(module__activation="identity", structure="increment")
    with pytest.raises(ValueError, match=r"stopped in epoch \d+: the .* Remedy: "):
        net.fit(X, Y)


def test_a_term_without_weight_is_not_asked():
    net = PGNNLRegressor(LAG, physics_loss=root, **QUICK).fit(X, Y)
    with pytest.raises(ValueError, match="root is not finite"):
        net.physics_residual(X)


def test_a_fit_may_be_given_its_epochs():
    options = {**QUICK, "max_epochs": 5, "refine": None, "horizon": 3, "rollout_epochs": 4}
    net = PGNNLRegressor(LAG, **options)
    assert len(net.fit(X, Y, epochs=2).history) == 2 + 4
    assert len(net.partial_fit(X, Y, epochs=1).history) == 2 + 4 + 1 + 4
    assert len(net.fit(X, Y).history) == 5 + 4
    rows = PGNNLRegressor(max_epochs=5, module__neurons=3)
    assert len(rows.fit(ROWS, TARGETS, epochs=2).history) == 2
