"""The paper's losses, in units and joules."""

import numpy as np
import pytest
import torch

from sklearn_pgnn import PGNNLRegressor, network, systems
from sklearn_pgnn.estimators.network.physics_loss import Motion, PhysicsLoss

CART = systems.cart_on_spring()
T = 0.02 * np.arange(80)
FORCE = np.sin(3 * T)
X = np.column_stack([T, FORCE])
Y = CART.simulate(T, FORCE, substeps=4).y


def energy(x):
    values = {name: p.value for name, p in CART.parameters.items()}
    return values["m"] * x[..., 1] ** 2 / 2 + values["k"] * x[..., 0] ** 2 / 2


def lack(x, u, t):
    """Return the energy that steps lack [J], by hand."""
    dt, v = np.diff(t), (x[1:, 1] + x[:-1, 1]) / 2
    return np.diff(energy(x)) + dt * (CART.parameters["d"].value * v**2 - u * v)


def test_a_residual_is_the_energy_that_a_step_lacks():
    x = np.random.default_rng(0).normal(size=(6, 2))
    t, u = np.cumsum([0, 0.1, 0.2, 0.1, 0.3, 0.1]), np.arange(5.0)
    motion = Motion(np.stack([x[:-1], x[1:]], 1), u[:, None, None], np.stack([t[:-1], t[1:]], 1))
    loss = PhysicsLoss([network.EnergyBalance()], CART, motion, scaled=False)
    window = [torch.as_tensor(part)[None] for part in (x, u[:, None], t)]
    assert loss.residuals(*window)[0][0, :, 0].numpy() == pytest.approx(lack(x, u, t))


@pytest.mark.parametrize("lambda_phy", [0.0, 0.25])
def test_the_loss_of_single_steps_is_the_papers(lambda_phy):
    seen = []

    class Watching(PGNNLRegressor):
        def get_loss(self, y_pred, y_true, X=None, training=False):
            loss = super().get_loss(y_pred, y_true, X, training)
            error = float(((y_pred.detach() - y_true) ** 2).sum(-1).mean())
            x, u, t = (X[name].numpy() for name in ("x", "u", "t"))
            steps = [
                lack(np.stack([x[k, 0], y_pred[k, 0].detach().numpy()]), u[k, :, 0], t[k])
                for k in range(len(x))
            ]
            seen.append(
                (float(loss), (1 - lambda_phy) * error + lambda_phy * np.mean(np.square(steps)))
            )
            return loss

    Watching(
        CART, structure="increment", lambda_phy=lambda_phy, scaled=False, max_epochs=1,
        refine=None, substeps=1,
    ).fit(X, Y)  # fmt: skip
    got, expected = np.transpose(seen)
    assert got == pytest.approx(expected, rel=1e-9)


def test_scaled_is_yes_or_no():
    with pytest.raises(ValueError, match="scaled: expected True or False, got 'J'"):
        PGNNLRegressor(CART, scaled="J").fit(X, Y)
