"""A network that takes energy out: it never brings any in, and its three loops agree."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from sklearn_pgnn import PhysicsModel
from sklearn_pgnn.estimators.network.cores import FeedForward
from sklearn_pgnn.estimators.network.step_network import (
    StepNetwork,
    ready_to_run,
    step_with,
    weights_of,
)
from sklearn_pgnn.estimators.network.torch_functions import dissipated
from sklearn_pgnn.simulation.dissipation import Dissipation, energy_model
from sklearn_pgnn.simulation.network_run import (
    FreeRun,
    NetworkStep,
    network_record,
    samples_of,
    term_values,
)
from sklearn_pgnn.simulation.simulate import simulate

ARM = PhysicsModel(
    states={"a": "rad", "b": "rad", "va": "rad/s", "vb": "rad/s"},
    parameters={"m": 1.0, "c": 0.4, "k": 3.0},
    equations={"a": "va", "b": "vb", "va": "u - k*sin(a)", "vb": "-k*b"},
    inputs={"u": "N*m"},
    energy={"stored": "(va**2 + m*vb**2)/2 + c*cos(a - b)*va*vb + k*b**2/2"},
)
TANK = PhysicsModel(
    {"h": "m"}, {"h": "u - 0.1*h"}, inputs={"u": "m/s"}, energy={"stored": "h**3/3"}
)
LOSSY = {"two states": ("va", "vb"), "one": ("vb",)}


def step_of(lossy, guide, rng):
    nothing = np.zeros((0, 4)), np.zeros((0, 1))
    width = {"terms": term_values(ARM, np.zeros(0), *nothing, np.ones(4))[0].shape[1]}
    n_in, m = 5 + {None: 0, "simulation": 4, **width}[guide], len(lossy)
    loss = Dissipation(lossy, rng.uniform(0.5, 2, m))
    return NetworkStep(
        ARM, "prior", guide, np.zeros(4), np.zeros((3, 4, loss.n_outputs)),
        rng.normal(size=n_in), rng.uniform(0.5, 2, n_in),
        np.array([[-1e3], [1e3]]) * np.ones(4), substeps=2, loss=loss,
    )  # fmt: skip


def record_of(rng, guide=None, n=40):
    t = np.cumsum(rng.uniform(0.005, 0.03, n))
    simulated = rng.normal(size=(n, 4)) if guide == "simulation" else None
    x0, u = rng.normal(size=4), 5 * np.sin(3 * t)[:, None]
    return network_record(ARM, t, u, x0, simulated=simulated)


def core_for(step, seed=0, size=1.0):
    torch.manual_seed(seed)
    core = FeedForward(len(step.mean), step.n_network_outputs, neurons=4).double()
    with torch.no_grad():
        for weight in core.parameters():
            weight.mul_(size)
    return core


def stored(x):
    values = {name: x[..., i] for i, name in enumerate(ARM.states)}
    a, b, va, vb = (values[name] for name in ARM.states)
    return (va**2 + vb**2) / 2 + 0.4 * np.cos(a - b) * va * vb + 1.5 * b**2


# -- the law ---------------------------------------------------------------------------------------


@settings(max_examples=60, deadline=None)
@given(
    m=st.integers(1, 4), size=st.floats(0, 50), dt=st.floats(1e-4, 100), flat=st.booleans(),
    seed=st.integers(0, 2**31 - 1),
)  # fmt: skip
def test_no_output_brings_energy_in(m, size, dt, flat, seed):
    rng = np.random.default_rng(seed)
    half = rng.normal(size=(m, m)) * (rng.uniform(size=m) < 0.5 if flat else 1.0)
    hessian, e = half @ half.T, rng.normal(size=m)
    out = size * rng.normal(size=(1, m * (m + 1) // 2))
    parts = np.concatenate([e, hessian.ravel()])[None]
    given_ = (torch.as_tensor(part) for part in (out, parts, rng.uniform(0.1, 9, m), [[dt]]))
    change = dissipated(*given_)[0].numpy()
    gained = e @ change + change @ hessian @ change / 2
    assert gained <= 1e-9 * (np.abs(e) @ np.abs(change))


@settings(max_examples=25, deadline=None)
@given(
    size=st.floats(0, 30), lossy=st.sampled_from([("va", "vb"), ("vb",)]),
    guide=st.sampled_from([None, "terms"]), seed=st.integers(0, 2**31 - 1),
)  # fmt: skip
def test_a_free_run_stores_no_more_than_the_models_steps_do(size, lossy, guide, seed):
    rng = np.random.default_rng(seed)
    step = step_of(lossy, guide, rng)
    record = record_of(rng)
    x, failed = ready_to_run(core_for(step, seed, size), step)(record)
    assert failed == -1
    for k in range(len(x) - 1):
        two = slice(k, k + 2)
        prior = simulate(ARM, record.t[two], record.acting[two], x[k], substeps=2).x[-1]
        assert stored(x[k + 1]) <= stored(prior) + 1e-9 * (1 + abs(stored(prior)))


def test_great_friction_brings_to_rest_and_no_further():
    out, root = torch.tensor([[1e6]]).double(), torch.ones(1).double()
    speed = torch.tensor([[3.0, 1.0]]).double()
    change = dissipated(out, speed, root, torch.tensor([[0.1]]).double())
    assert change.item() == pytest.approx(-3.0, abs=1e-6)
    assert 3.0 + change.item() >= 0


# -- one step, three loops -------------------------------------------------------------------------


@pytest.mark.parametrize("guide", [None, "simulation", "terms"])
@pytest.mark.parametrize("lossy", LOSSY.values(), ids=LOSSY)
def test_torch_and_the_compiled_loop_agree(lossy, guide):
    rng = np.random.default_rng(1)
    step, record = step_of(lossy, guide, rng), record_of(rng, guide)
    core = core_for(step)
    x, failed = ready_to_run(core, step)(record)
    network = StepNetwork(core, step, samples_of(record.t, record.acting))
    network.teacher_forcing = False
    window = {
        "x": torch.as_tensor(record.x0)[None, None],
        "u": torch.as_tensor(record.u[:-1])[None],
        "t": torch.as_tensor(record.t)[None],
        "index": torch.arange(len(record.t) - 1)[None],
    }
    if guide == "simulation":
        window["simulated"] = torch.as_tensor(record.simulated[1:])[None]
    found = network(**window)
    assert failed == -1
    assert x[1:] == pytest.approx(found[0].detach().numpy(), rel=1e-10, abs=1e-10)
    # the slopes of torch are those of the sensitivities
    theta = weights_of(core)
    S = next(iter(FreeRun(step_with(core, step), theta, differs=True).pieces(record, [0, 39])))[2]
    for i in range(4):
        by_torch = torch.autograd.grad(found[0, -1, i], core.parameters(), retain_graph=True)
        by_torch = torch.nn.utils.parameters_to_vector(by_torch).numpy()
        assert by_torch == pytest.approx(S[-1, i], rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("guide", [None, "simulation", "terms"])
@pytest.mark.parametrize("lossy", LOSSY.values(), ids=LOSSY)
def test_sensitivities_are_the_derivatives(lossy, guide):
    rng = np.random.default_rng(7)
    step, record = step_of(lossy, guide, rng), record_of(rng, guide)
    core = core_for(step)
    step, theta = replace(step_with(core, step), free=("k",)), np.append(weights_of(core), 0.0)
    columns = []
    for i in range(theta.size):
        ends = [theta.copy(), theta.copy()]
        ends[0][i] += 1e-6
        ends[1][i] -= 1e-6
        up, down = (FreeRun(step, end)(record)[0] for end in ends)
        columns.append((up - down) / 2e-6)
    expected = np.stack(columns, axis=-1)
    pieces = list(FreeRun(step, theta, differs=True).pieces(record, np.arange(40), 16))
    found = np.concatenate([S[min(i, 1) :] for i, (_, _, S) in enumerate(pieces)])
    assert np.abs(expected).max() > 1e-3
    assert found == pytest.approx(expected, rel=1e-5, abs=1e-6 * np.abs(expected).max())


def test_the_energys_parts():
    model = energy_model(TANK, ("h",))
    assert [str(part) for part in model.outputs.values()] == ["h**2", "2*h"]
