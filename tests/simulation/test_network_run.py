"""The compiled loop of a network in feedback, and its sums, against slower ones to believe."""

import os
import pickle
import subprocess
import sys
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

import sklearn_pgnn
from sklearn_pgnn import effects, systems
from sklearn_pgnn.estimators.network.cores import FeedForward, Recurrent
from sklearn_pgnn.estimators.network.step_network import (
    StepNetwork,
    ready_to_run,
    step_with,
    weights_of,
)
from sklearn_pgnn.estimators.network.structure import BASE_OF, gain_of
from sklearn_pgnn.simulation.lanes import LANES, tanh_lanes, weigh
from sklearn_pgnn.simulation.network_run import (
    ACTIVATIONS,
    FreeRun,
    NetworkStep,
    names_in_terms,
    network_record,
    prior_steps,
    samples_of,
    term_values,
)
from sklearn_pgnn.simulation.simulate import simulate

CART = systems.cart_on_spring()
GOLF = systems.golf_robot()
HARDENING = CART + effects.CubicStiffness("v", stiffness=3.0)  # its terms: x, v, force, x**3
STRUCTURES = ("output", "increment", "correction")
GUIDES = (None, "simulation", "step", "terms")
N_FEATURES = 2


def clock(n, rng=None):
    """Return a time of even steps, or of uneven ones."""
    return np.arange(n) * 0.02 if rng is None else np.cumsum(rng.uniform(0.005, 0.03, n))


def record_of(model, rng, *, n=60, hold="zoh", uneven=True, size=5.0):
    """Return a trajectory with a simulation and further columns of random numbers."""
    t = clock(n, rng if uneven else None)
    u = size * np.sin(3 * t + rng.uniform(0, 6))[:, None] * np.ones((1, len(model.inputs)))
    return network_record(
        model, t, u, rng.normal(size=len(model.states)) * 0.3, hold=hold,
        simulated=rng.normal(size=(n, len(model.states))),
        features=rng.normal(size=(n, N_FEATURES)),
    )  # fmt: skip


def width_of(guide, model):
    if guide == "terms":
        nothing = (np.zeros((0, n)) for n in (len(model.states), len(model.inputs)))
        return term_values(model, np.zeros(0), *nothing, np.ones(len(model.states)))[0].shape[1]
    return len(model.states) if guide else 0


def step_of(model, structure, guide, rng, *, hold="zoh", substeps=2):
    """Return a step with random scales."""
    nx, nu = len(model.states), len(model.inputs)
    n_in = nx + nu + width_of(guide, model) + N_FEATURES
    some = rng.normal(size=(3, 8, nx))
    return NetworkStep(
        model, BASE_OF[structure], guide, rng.normal(size=nx),
        gain_of(model, structure, *some, np.full(8, 0.5)),
        rng.normal(size=n_in), rng.uniform(0.5, 2, n_in),
        np.array([[-1e3], [1e3]]) * np.ones(nx), substeps=substeps, hold=hold,
    )  # fmt: skip


def bare(record, step):
    """Return the trajectory without the simulation, where the network is not guided by it."""
    if step.guide == "simulation":
        return record
    return replace(record, simulated=np.zeros((record.t.size, 0)))


def core_for(step, kind, seed=0, neurons=4):
    torch.manual_seed(seed)
    sizes = {"n_inputs": len(step.mean), "n_outputs": step.n_network_outputs, "neurons": neurons}
    core = Recurrent(**sizes) if kind == "recurrent" else FeedForward(**sizes, activation=kind)
    return core.double()


def as_module(core, step, record):
    """Return the torch network and the trajectory as its one window, the prediction fed back."""
    network = StepNetwork(core, step, samples_of(record.t, record.acting))
    network.teacher_forcing = False
    n = record.t.size - 1
    window = {
        "x": torch.as_tensor(record.x0)[None, None],
        "u": torch.as_tensor(record.u[:-1])[None],
        "t": torch.as_tensor(record.t)[None],
        "index": torch.arange(n)[None],
        "features": torch.as_tensor(record.features[1:])[None],
    }
    if step.guide == "simulation":
        window["simulated"] = torch.as_tensor(record.simulated[1:])[None]
    return network, window


def by_torch(core, step, record):
    network, window = as_module(core, step, record)
    with torch.no_grad():
        return np.vstack([record.x0, network(**window)[0].numpy()])


def by_hand(core, step, record):
    """Run the network as its equation says; the model's step is the simulation of two samples."""
    model, x, found = step.model, record.x0, [record.x0]
    hidden = core.at_rest(1) if hasattr(core, "at_rest") else None
    for k, dt in enumerate(np.diff(record.t)):
        two = slice(k, k + 2)
        options = {"substeps": step.substeps, "hold": step.hold}
        phi = simulate(model, record.t[two], record.acting[two], x, **options).x[-1]
        guide = {None: [], "step": (phi - x) / dt, "terms": [x[0] ** 3]}
        if step.guide == "simulation":
            guide["simulation"] = record.simulated[k + 1]
        seen = np.concatenate([x, record.u[k], guide[step.guide], record.features[k + 1]])
        z = torch.as_tensor((seen - step.mean) / step.scale)[None]
        out = core(z) if hidden is None else core(z, hidden)
        out, hidden = (out, None) if hidden is None else out
        base = {"constant": step.offset, "state": x, "prior": phi}[step.base]
        x = base + (step.gain[0] + dt * step.gain[1] + dt**2 * step.gain[2]) @ out[0].numpy()
        found.append(x)
    return np.array(found)


# -- one loop, three ways --------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [*ACTIVATIONS, "recurrent"])
@pytest.mark.parametrize(("structure", "guide"), [*product(STRUCTURES, GUIDES)])
def test_three_loops_agree(structure, guide, kind):
    rng = np.random.default_rng(0)
    for hold in ("zoh", "foh"):
        step = step_of(HARDENING, structure, guide, rng, hold=hold)
        record = bare(record_of(HARDENING, rng, hold=hold), step)
        core = core_for(step, kind)
        x, failed = ready_to_run(core, step)(record)
        assert failed == -1
        assert np.ptp(x[5:], axis=0).min() > 1e-7
        assert x == pytest.approx(by_torch(core, step, record), rel=1e-10, abs=1e-10)
        with torch.no_grad():
            assert x == pytest.approx(by_hand(core, step, record), rel=1e-10, abs=1e-10)


def test_deep_and_narrow_networks_agree():
    rng = np.random.default_rng(1)
    step = step_of(GOLF, "correction", "step", rng)
    record = bare(record_of(GOLF, rng, size=0.3), step)
    for neurons, layers in ((1, 1), (1, 4), (40, 1)):
        torch.manual_seed(neurons)
        core = FeedForward(len(step.mean), 1, neurons=neurons, layers=layers).double()
        x = ready_to_run(core, step)(record)[0]
        assert x == pytest.approx(by_torch(core, step, record), rel=1e-10, abs=1e-10)


numbers = st.floats(-3, 3, allow_nan=False, width=32)


@settings(max_examples=40)
@given(
    structure=st.sampled_from(STRUCTURES),
    guide=st.sampled_from(GUIDES),
    layers=st.integers(1, 3),
    neurons=st.integers(1, 5),
    size=numbers,
    seed=st.integers(0, 2**31 - 1),
)
def test_any_network_is_followed_or_flagged(structure, guide, layers, neurons, size, seed):
    rng = np.random.default_rng(seed)
    step = step_of(HARDENING, structure, guide, rng)
    record = bare(record_of(HARDENING, rng, n=40), step)
    torch.manual_seed(seed)
    core = FeedForward(len(step.mean), step.n_network_outputs, neurons, layers, "silu").double()
    with torch.no_grad():
        for weight in core.parameters():
            weight.mul_(10 * size)
    x, failed = ready_to_run(core, step)(record)
    expected = by_torch(core, step, record)
    outside = np.any(~(np.abs(expected) <= 1e3), axis=1)
    assert failed == (int(np.argmax(outside)) if outside.any() else -1)
    assert np.isfinite(x).all()
    whole = len(x) if failed < 0 else failed
    assert x[:whole] == pytest.approx(expected[:whole], rel=1e-6, abs=1e-8)
    assert np.array_equal(x[whole:], np.repeat(x[whole - 1 : whole], len(x) - whole, axis=0))


# -- the model alone -------------------------------------------------------------------------------


def idle(step):
    """Return the step of a network whose output is zero, and its weights."""
    n_in, n_out = len(step.mean), step.n_network_outputs
    return replace(step, sizes=(n_in, n_out)), np.zeros((n_in + 1) * n_out)


@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize(
    "model",
    [CART, GOLF, CART + effects.InputDelay("force", delay=0.047), systems.two_tanks()],
    ids=["cart", "dry friction", "delay", "tanks"],
)
def test_zero_weights_are_the_model_itself(model, hold):
    rng = np.random.default_rng(2)
    t = np.cumsum(rng.uniform(0.01, 0.02, 300))  # a longer interval would take more steps
    u = np.where(np.sin(4 * t) > 0, 0.06, 0.0)[:, None] + 0.04 * np.sin(t)[:, None]
    x0 = [5.0, 4.0] if "pump" in model.inputs else [0.3, 0.0]
    step = replace(
        step_of(model, "correction", None, rng, hold=hold, substeps=3),
        mean=np.zeros(3), scale=np.ones(3),
    )  # fmt: skip
    record = network_record(model, t, u, x0, hold=hold)
    x, failed = FreeRun(*idle(step))(record)
    assert failed == -1
    assert np.array_equal(x, simulate(model, t, u, x0, substeps=3, hold=hold).x)
    if model is GOLF:  # it does stick
        assert np.sum(x[:, 1] == 0.0) > 20


def test_increment_of_nothing_stays():
    rng = np.random.default_rng(3)
    step = step_of(CART, "increment", None, rng)
    record = bare(record_of(CART, rng), step)
    assert np.array_equal(FreeRun(*idle(step))(record)[0], np.tile(record.x0, (60, 1)))


def test_constant_acceleration_moves_position_by_half_the_step_squared():
    rng = np.random.default_rng(4)
    free = CART.replace(equations={"x": "v", "v": "0"}, energy={})
    step = step_of(free, "correction", None, rng)
    record = bare(record_of(free, rng), step)
    step, theta = idle(step)
    theta[-1] = 1.0 / step.gain[1, 1, 0]  # the bias: 1 m/s^2
    x, t = FreeRun(step, theta)(record)[0], record.t - record.t[0]
    assert x[:, 1] == pytest.approx(record.x0[1] + t)
    assert x[:, 0] == pytest.approx(record.x0[0] + record.x0[1] * t + t**2 / 2)


# -- what does not come back -----------------------------------------------------------------------


@pytest.mark.parametrize("weight", [50.0, np.nan, np.inf])
@pytest.mark.parametrize("structure", STRUCTURES)
def test_out_of_reach_is_flagged_and_finite(structure, weight):
    rng = np.random.default_rng(5)
    step = step_of(CART, structure, None, rng)
    record = bare(record_of(CART, rng), step)
    step, theta = idle(step)
    theta[:] = weight * 1e3
    x, failed = FreeRun(step, theta)(record)
    assert failed > 0
    assert np.isfinite(x).all()
    assert np.array_equal(x[failed:], np.tile(x[failed - 1], (len(x) - failed, 1)))
    pieces = list(FreeRun(step, theta, differs=True).pieces(record, np.arange(60), 10))
    assert not np.isfinite(np.concatenate([x for _, x, _ in pieces])).all()


def test_one_sample_is_its_own_start():
    rng = np.random.default_rng(6)
    step = step_of(CART, "correction", None, rng)
    record = bare(record_of(CART, rng, n=1), step)
    for kind in ("tanh", "recurrent"):
        x, failed = ready_to_run(core_for(step, kind), step)(record)
        assert failed == -1
        assert np.array_equal(x, record.x0[None])


# -- sensitivities ---------------------------------------------------------------------------------


def differences(step, theta, record, small=1e-6):
    """Differentiate the states by the weights, by central differences."""
    columns = []
    for i in range(theta.size):
        ends = []
        for sign in (1, -1):
            moved = theta.copy()
            moved[i] += sign * small
            ends.append(FreeRun(step, moved)(record)[0])
        columns.append((ends[0] - ends[1]) / (2 * small))
    return np.stack(columns, axis=-1)


def sensitivities(step, theta, record, length=512):
    samples = np.arange(len(record.t))
    pieces = list(FreeRun(step, theta, differs=True).pieces(record, samples, length))
    parts = [S[(1 if samples[0] else 0) :] for samples, _, S in pieces]
    return np.concatenate(parts)


@pytest.mark.parametrize("activation", ACTIVATIONS)
@pytest.mark.parametrize(("structure", "guide"), [*product(STRUCTURES, GUIDES)])
def test_sensitivities_are_the_derivatives(structure, guide, activation):
    rng = np.random.default_rng(7)
    step = step_of(HARDENING, structure, guide, rng)
    record = bare(record_of(HARDENING, rng, n=40), step)
    core = core_for(step, activation)
    step, theta = step_with(core, step), weights_of(core)
    expected = differences(step, theta, record)
    found = sensitivities(step, theta, record)
    assert np.abs(expected).max() > 1e-3
    assert found == pytest.approx(expected, rel=1e-5, abs=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("torque", [0.05, 1.5], ids=["sticks", "turns round at once"])
def test_sensitivities_jump_where_the_friction_changes_its_side(torque):
    rng = np.random.default_rng(8)
    t = clock(150)
    u = torque * np.sign(np.sin(5 * t + 0.3))[:, None]
    step = replace(
        step_of(GOLF, "correction", None, rng),
        mean=np.zeros(3), scale=np.ones(3),
        gain=np.array([[[0.0], [0.0]], [[0.0], [1.0]], [[0.5], [0.0]]]),
    )  # fmt: skip
    record = network_record(GOLF, t, u, [0.4, 0.1])
    torch.manual_seed(0)
    core = FeedForward(3, 1, neurons=3, layers=1).double()
    step, theta = step_with(core, step), weights_of(core)
    x = FreeRun(step, theta)(record)[0]
    assert np.sum(np.diff(np.sign(x[:, 1])) != 0) >= 4
    expected, found = differences(step, theta, record), sensitivities(step, theta, record)
    # where a sample and an event meet, differences straddle the corner: it may be a few samples
    near = np.isclose(found, expected, rtol=1e-3, atol=1e-4 * np.abs(expected).max())
    assert near.mean() > 0.99
    assert near[-1].all()


def test_pieces_make_no_difference():
    rng = np.random.default_rng(9)
    step = step_of(GOLF, "correction", "step", rng)
    record = bare(record_of(GOLF, rng, size=0.3), step)
    core = core_for(step, "tanh")
    step, theta = step_with(core, step), weights_of(core)
    whole = sensitivities(step, theta, record)
    assert np.array_equal(sensitivities(step, theta, record, length=7), whole)
    wanted, states = np.arange(2, len(record.t), 3), FreeRun(step, theta)(record)[0]
    for samples, x, S in FreeRun(step, theta, differs=True).pieces(record, wanted, 7):
        assert np.array_equal(S, whole[samples])
        assert x == pytest.approx(states[samples])


# -- autograd through the model --------------------------------------------------------------------


@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize("model", [CART, systems.two_tanks(), GOLF], ids=lambda m: m.name)
def test_gradient_of_the_models_own_step(model, hold):
    rng = np.random.default_rng(10)
    step = step_of(model, "correction", None, rng, hold=hold)
    record = record_of(model, rng, n=6, hold=hold, size=0.3)
    network, window = as_module(core_for(step, "tanh"), step, record)
    x = torch.as_tensor(rng.uniform(1, 2, (5, 2))).requires_grad_()
    assert torch.autograd.gradcheck(lambda x: network.prior(x, window["index"][0]), x)


def test_steps_of_the_model_are_its_simulation():
    rng = np.random.default_rng(11)
    t, dt = rng.uniform(0, 5, 20), rng.uniform(0.01, 0.1, 20)
    x, u, u_next = (rng.normal(size=(20, m)) for m in (2, 1, 1))
    for hold in ("zoh", "foh"):
        found, _ = prior_steps(GOLF, 2, hold, t, dt, x, u, u_next)
        for k in range(20):
            ends, inputs = [t[k], t[k] + dt[k]], [u[k], u_next[k]]
            expected = simulate(GOLF, ends, inputs, x[k], substeps=2, hold=hold).x[-1]
            assert found[k] == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(("structure", "guide"), [*product(STRUCTURES, GUIDES)])
def test_gradient_of_a_rollout_is_that_of_the_sensitivities(structure, guide):
    rng = np.random.default_rng(12)
    step = step_of(GOLF, structure, guide, rng)
    record = bare(record_of(GOLF, rng, n=30, size=0.5), step)
    core = core_for(step, "tanh")
    network, window = as_module(core, step, record)
    weights = rng.normal(size=(29, 2))
    (network(**window)[0] * torch.as_tensor(weights)).sum().backward()
    gradient = np.concatenate([p.grad.numpy().ravel() for p in core.parameters()])
    S = sensitivities(step_with(core, step), weights_of(core), record)
    expected = np.einsum("ki,kiw->w", weights, S[1:])
    assert gradient == pytest.approx(expected, rel=1e-8, abs=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("model", "quantities"),
    [
        (systems.golf_robot(), [{"phi"}, *[{"phi", "omega"}] * 3]),
        (systems.two_tanks(), [{"x1"}, {"x2"}]),
        (systems.servo_valve(limits=True), []),  # each of its rates is limited as a whole
    ],
)
def test_the_terms_that_guide_a_network_are_parts_of_the_rates(model, quantities):
    assert names_in_terms(model) == quantities


SCRIPT = """
import pickle, sys
import numpy as np
from sklearn_pgnn.simulation.network_run import FreeRun
step, theta, record = pickle.load(open(sys.argv[1], "rb"))
samples = np.arange(record.t.size)
*_, (_, x, S) = FreeRun(step, theta, differs=True).pieces(record, samples)
np.savez(sys.argv[2], alone=FreeRun(step, theta)(record)[0], x=x, S=S)
"""


@pytest.mark.slow
@pytest.mark.parametrize("plain_calls", ["0", "1"], ids=["by address", "by numba's objects"])
def test_a_network_gives_the_same_bits_in_another_process(tmp_path, plain_calls):
    rng = np.random.default_rng(4)
    step = step_of(CART, "correction", "step", rng)
    core, record = core_for(step, "tanh"), bare(record_of(CART, rng), step)
    given = step_with(core, step), weights_of(core), record
    (tmp_path / "network.pickle").write_bytes(pickle.dumps(given))
    path = os.pathsep.join([str(Path(sklearn_pgnn.__file__).parents[1]), *sys.path])
    subprocess.run(
        [sys.executable, "-c", SCRIPT, tmp_path / "network.pickle", tmp_path / "result.npz"],
        env={**os.environ, "PYTHONPATH": path, "SKLEARN_PGNN_PLAIN_CALLS": plain_calls},
        check=True,
    )
    result = np.load(tmp_path / "result.npz")
    assert np.array_equal(result["alone"], FreeRun(*given[:2])(record)[0])
    *_, (_, x, S) = FreeRun(*given[:2], differs=True).pieces(record, np.arange(record.t.size))
    assert np.array_equal(result["x"], x)
    assert np.array_equal(result["S"], S)


@njit
def all_tangents(given, found):
    for row in range(given.shape[0]):
        for place in range(0, given.shape[1], LANES):
            tanh_lanes(given, found, row, place)


@njit
def weighed(weights, bias, first, stride, n_in, given, row, sums, place):
    weigh(weights, bias, first, stride, n_in, given, row, sums, place)


def tangents(values):
    given = np.zeros((2, -(-len(values) // (2 * LANES)) * LANES))
    given.flat[: len(values)] = values
    found = np.full(given.shape, -7.0)
    all_tangents(given, found)
    return found.ravel()[: len(values)]


@pytest.mark.parametrize("reach", [1e-9, 0.4, 3.0, 25.0, 1e3, 1e300])
def test_the_tangent_is_right_to_the_last_digits_of_one(reach):
    values = np.concatenate([np.linspace(-reach, reach, 4001), reach * np.geomspace(1e-9, 1, 800)])
    np.testing.assert_allclose(tangents(values), np.tanh(values), rtol=0, atol=4e-16)


def test_the_tangent_of_what_is_no_number():
    values = np.array([np.inf, -np.inf, np.nan, 0.0, -0.0])
    np.testing.assert_array_equal(tangents(values), [1.0, -1.0, np.nan, 0.0, 0.0])


@pytest.mark.parametrize("n_in", [0, 1, 7, 20])
def test_weighs_one_row_into_the_lanes_of_the_next(n_in):
    random = np.random.default_rng(0)
    wide, lane, row = 3 * LANES, LANES, 1
    weights, given = random.normal(size=(n_in + 1) * wide + 5), random.normal(size=(3, 24))
    sums = np.zeros((3, wide))
    weighed(weights, 5 + n_in * wide + lane, 5 + lane, wide, n_in, given, row, sums, lane)
    matrix = weights[5:].reshape(n_in + 1, wide)
    expected = np.zeros((3, wide))
    expected[row + 1, lane : 2 * lane] = (given[row, :n_in] @ matrix[:-1] + matrix[-1])[
        lane : 2 * lane
    ]
    np.testing.assert_allclose(sums, expected, atol=1e-14)
