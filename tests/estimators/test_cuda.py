"""A network is trained on a graphics card as on the processor, and its pickle needs no card."""

import os
import pickle
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
import torch

from sklearn_pgnn import PGNNLRegressor, PhysicsModel
from sklearn_pgnn.network import EnergyBalance, Recurrent

pytestmark = pytest.mark.skipif(not torch.cuda.is_available(), reason="no graphics card here")

CART = PhysicsModel(
    {"x": "m", "v": "m/s"},
    {"x": "v", "v": "(F - d*v - k*x)/m"},
    {"m": {"value": 1.0, "spread": 0.2}, "d": {"value": 0.4, "spread": 0.5}, "k": 2.0},
    {"F": "N"},
    energy={"stored": "m*v**2/2 + k*x**2/2", "dissipated": "d*v**2", "supplied": "F*v"},
)
MACHINE = CART.replace(equations={"x": "v", "v": "(F - d*v - k*x - 1.5*x**3)/m"})
QUICK = {"max_epochs": 8, "module__neurons": 4, "refine_max_iter": 10, "rollout_epochs": 3}


def records(n_records=4, n=120):
    frames, outputs = [], []
    for i in range(n_records):
        t = np.arange(n) * 0.05
        force = 2.0 * np.sin((1 + 0.4 * i) * t) + np.cos(2.3 * t)
        frames.append(pd.DataFrame({"t": t, "F": force, "trajectory": i}))
        outputs.append(MACHINE.simulate(t, force).y)
    return pd.concat(frames, ignore_index=True), np.concatenate(outputs)


X, Y = records()


@pytest.mark.parametrize(
    "options",
    [
        {"structure": "output"},
        {"structure": "increment"},
        {"structure": "correction"},
        {"structure": "correction", "guide": "simulation", "horizon": 5},
        {"structure": "correction", "free": ["m", "d"]},
        {"structure": "correction", "free": ["m", "d"], "corrects": ["v"], "horizon": 5},
        {"structure": "dissipative"},
        {"structure": "correction", "lambda_phy": 0.05},
        {"structure": "correction", "lambda_phy": "adaptive"},
        {
            "lambda_phy": 0.05,
            "physics_loss": EnergyBalance(dissipated="d*v**2"),
            "free": ["m", "d"],
        },
        {"refine": "lbfgs"},
        {"module": Recurrent, "refine": None},
    ],
    ids=str,
)
def test_a_card_trains_what_the_processor_trains(options):
    on_card, on_processor = (
        PGNNLRegressor(CART, device=device, **{**QUICK, **options}).fit(X, Y)
        for device in ("cuda", "cpu")
    )
    assert next(on_card.module_.parameters()).device.type == "cuda"
    scores = [net.score(X, Y) for net in (on_card, on_processor)]
    assert scores[0] == pytest.approx(scores[1], abs=0.05)
    found = on_card.predict(X)
    again = pickle.loads(pickle.dumps(on_card)).predict(X)
    np.testing.assert_allclose(again, found, rtol=1e-6, atol=1e-9)
    assert on_card.predict_states(X).shape == (len(X), 2)
    if "module" not in options:
        assert np.isfinite(on_card.predict_ahead(X, Y, 3)).all()
        assert on_card.stepper(x0=[0.0, 0.0]).step([1.0]).shape == (2,)
    assert np.isfinite(on_card.physics_residual(X)[1:]).any()


def test_a_number_to_the_power_of_a_state_is_trained_on_a_card():
    shown = {"r": "2**x + 0.1*v"}
    model, machine = (each.replace(outputs=shown) for each in (CART, MACHINE))
    y = np.concatenate([machine.simulate(r.t, r.F).y for _, r in X.groupby("trajectory")])
    nets = [
        PGNNLRegressor(model, device=device, horizon=5, **QUICK).fit(X, y)
        for device in ("cuda", "cpu")
    ]
    np.testing.assert_allclose(*(net.predict(X) for net in nets), rtol=1e-4, atol=1e-4)


def test_rows_without_a_time_are_learned_on_a_card_too():
    rng = np.random.default_rng(0)
    rows = rng.normal(size=(200, 3))
    y = rows @ [1.0, -2.0, 0.5]
    net = PGNNLRegressor(device="cuda", max_epochs=30).fit(rows, y)
    assert net.score(rows, y) > 0.95
    np.testing.assert_allclose(pickle.loads(pickle.dumps(net)).predict(rows), net.predict(rows))


def test_a_training_goes_on_on_a_card():
    net = PGNNLRegressor(CART, device="cuda", **QUICK).fit(X, Y)
    assert net.partial_fit(X, Y).score(X, Y) > 0.9


def test_what_a_card_has_trained_predicts_without_one(tmp_path):
    net = PGNNLRegressor(CART, device="cuda", **QUICK).fit(X, Y)
    file = tmp_path / "net.pickle"
    file.write_bytes(pickle.dumps((net, X, net.predict(X))))
    code = (
        "import pickle, sys, numpy, torch\n"
        "net, X, found = pickle.load(open(sys.argv[1], 'rb'))\n"
        "assert not torch.cuda.is_available()\n"
        "numpy.testing.assert_allclose(net.predict(X), found, rtol=1e-6)\n"
    )
    hidden = {**os.environ, "CUDA_VISIBLE_DEVICES": ""}
    subprocess.run([sys.executable, "-c", code, str(file)], env=hidden, check=True)
