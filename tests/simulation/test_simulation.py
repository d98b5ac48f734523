"""Laws of the simulation: exact solutions, balances, other integrators, finite differences."""

import os
import pickle
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import sklearn_pgnn
from sklearn_pgnn import Parameter, PhysicsModel, effects, systems
from sklearn_pgnn.exceptions import SimulationError, SimulationWarning
from sklearn_pgnn.physics.expressions import FUNCTIONS, TIME, symbol
from sklearn_pgnn.simulation import simulate
from sklearn_pgnn.simulation.hidden_input import find_hidden_input
from sklearn_pgnn.simulation.normal_equations import project
from sklearn_pgnn.simulation.pointwise import evaluate_samples
from sklearn_pgnn.simulation.record_windows import window_records
from sklearn_pgnn.simulation.uncertainty import standard_errors
from sklearn_pgnn.simulation.window_fit import ParameterPrior, expected_decrease, fit_windows
from sklearn_pgnn.simulation.windows import evaluate
from sklearn_pgnn.trajectories import read_records

pytestmark = pytest.mark.core

LAG = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
PENDULUM = PhysicsModel(
    states={"phi": "rad", "omega": "rad/s"},
    inputs={"M": "N m"},
    parameters={"J": 0.15, "k": 2.4, "d": 0.02},
    equations={"phi": "omega", "omega": "(M - k*sin(phi) - d*omega)/J"},
    inertia={"omega": "J"},
)
#: a mass on a rough table; without drive it stops
SLIDER = PhysicsModel(
    states={"v": "m/s"}, inputs={"F": "N"}, parameters={"m": 2.0}, equations={"v": "F/m"},
    inertia={"v": "m"},
) + effects.CoulombFriction("v", level=1.0)  # fmt: skip
T = np.arange(0, 3, 0.01)


def torque(t):
    return 0.8 * np.sin(2.1 * t) + 0.5 * np.sin(5.3 * t + 1)


def dense(model, t, u, x0, hold="zoh"):
    """Integrate sample by sample with SciPy's tightest tolerance."""
    values = {symbol(name): p.value for name, p in model.parameters.items()}
    names = [TIME, *map(symbol, [*model.states, *model.inputs])]
    f = sympy.lambdify(names, [e.subs(values) for e in model.equations.values()], "numpy")
    x, states = np.asarray(x0, dtype=float), [x0]
    for k in range(t.size - 1):
        h = t[k + 1] - t[k]
        slope = (u[k + 1] - u[k]) / h if hold == "foh" else 0 * u[k]

        def rhs(s, x, k=k, slope=slope):
            return np.array(f(s, *x, *(u[k] + slope * (s - t[k]))), dtype=float)

        x = solve_ivp(rhs, (t[k], t[k + 1]), x, rtol=1e-9, atol=1e-12, method="DOP853").y[:, -1]
        states.append(x)
    return np.array(states)


def by_differences(model, name, step, **options):
    """Differentiate the outputs by a parameter, or by an initial state, by central differences."""
    x0 = np.asarray(options.pop("x0"), dtype=float)

    def run(sign):
        if name in model.parameters:
            value = model.parameters[name].value + sign * step
            return simulate(model.with_parameters(**{name: value}), x0=x0, **options).y
        shift = sign * step * np.eye(x0.size)[list(model.states).index(name.removesuffix("(0)"))]
        return simulate(model, x0=x0 + shift, **options).y

    return (run(1) - run(-1)) / (2 * step)


# -- accuracy -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("method", "order"), [("euler", 1), ("rk4", 4)])
def test_error_falls_with_the_order_of_the_method(method, order):
    t, x0 = np.linspace(0, 2, 21), [1.0, 0.0]
    u = torque(t)[:, None]
    exact = dense(PENDULUM, t, u, x0)
    counts = np.array([4, 8, 16])
    errors = [
        np.abs(simulate(PENDULUM, t, u, x0, method=method, substeps=int(n)).x - exact).max()
        for n in counts
    ]
    slope = np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert slope == pytest.approx(-order, abs=0.15)


def test_frictionless_pendulum_keeps_its_energy():
    free = PENDULUM.with_parameters(d=0.0)
    run = simulate(free, np.arange(0, 60, 0.01), np.zeros(6000), [2.0, 0.0])
    phi, omega = run.x.T
    energy = 0.15 * omega**2 / 2 + 2.4 * (1 - np.cos(phi))
    assert np.ptp(energy) < 1e-6 * energy.mean()


@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_agrees_with_scipy(hold):
    u = torque(T)[:, None]
    run = simulate(PENDULUM, T, u, [0.3, -1.0], hold=hold, substeps=8)
    assert run.success
    assert run.x == pytest.approx(dense(PENDULUM, T, u, [0.3, -1.0], hold), abs=1e-8)


def test_linear_system_under_held_input_follows_the_matrix_exponential():
    t = np.arange(0, 5, 0.05)
    u = np.sign(np.sin(3 * t))
    cart = systems.cart_on_spring()
    A, B = np.array([[0, 1], [-20, -0.75]]), np.array([0, 0.5])
    step = expm(np.block([[A, B[:, None]], [np.zeros((1, 3))]]) * 0.05)
    x, states = np.zeros(2), []
    for force in u:
        states.append(x)
        x = step[:2, :2] @ x + step[:2, 2] * force
    assert simulate(cart, t, u, substeps=20).x == pytest.approx(np.array(states), abs=1e-8)


def test_holds_differ_by_half_a_sample():
    t = np.arange(0, 4, 0.1)
    u = t.copy()  # a ramp: held, it acts half a sample late
    held = simulate(LAG, t, u).y[:, 0]
    straight = simulate(LAG, t, u, hold="foh").y[:, 0]
    assert straight == pytest.approx(t - 2 * (1 - np.exp(-t / 2)), abs=1e-7)
    assert straight - held == pytest.approx(0.05 * (1 - np.exp(-t / 2)), abs=1e-3)


def test_uneven_sampling_is_stepped_on_its_own_clock():
    rng = np.random.default_rng(0)
    t = np.cumsum(rng.uniform(0.005, 0.1, 200))
    u = torque(t)[:, None]
    run = simulate(PENDULUM, t, u, [0.1, 0.0], substeps=16)
    assert run.x == pytest.approx(dense(PENDULUM, t, u, [0.1, 0.0]), abs=1e-7)


def test_time_may_stand_in_the_equations():
    clock = PhysicsModel({"y": ""}, {"y": "cos(w*t)"}, {"w": 3.0})
    run = simulate(clock, T + 1, x0=[0.0], substeps=4)
    assert run.y[:, 0] == pytest.approx((np.sin(3 * (T + 1)) - np.sin(3)) / 3, abs=1e-9)


# -- late inputs ----------------------------------------------------------------------------------


@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_delay_of_whole_samples_shifts_exactly(hold):
    late = PENDULUM + effects.InputDelay("M", delay=0.07)
    u = torque(T)
    u[:20] = u[0] = 0.0
    now = simulate(PENDULUM, T, u, hold=hold).x
    then = simulate(late, T, u, hold=hold).x
    assert then[7:] == pytest.approx(now[:-7], abs=1e-10)
    assert np.all(then[:20] == 0)


def test_delay_of_part_of_a_sample_keeps_the_impulse():
    t = np.arange(0, 1, 0.1)
    u = np.where(t >= 0.35, 1.0, 0.0)
    integrator = PhysicsModel({"y": ""}, {"y": "u"}, {}, {"u": ""})
    late = integrator + effects.InputDelay("u", delay=0.025)
    difference = simulate(integrator, t, u).y[-1] - simulate(late, t, u).y[-1]
    assert difference == pytest.approx(0.025, abs=1e-12)


@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_sensitivity_to_a_delay(hold):
    late = PENDULUM + effects.InputDelay("M", delay=0.073)
    delay = late.delays["M"]
    options = {"t": T, "u": torque(T), "hold": hold}
    run = simulate(late, x0=[0.2, 0.0], wrt=(delay,), **options)
    numeric = by_differences(late, delay, 1e-6, x0=[0.2, 0.0], **options)
    assert run.sensitivities[:, :, 0] == pytest.approx(numeric, abs=1e-5)


# -- sensitivities --------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["euler", "rk4"])
def test_sensitivities_are_the_derivatives_of_what_was_computed(method):
    options = {"t": T, "u": torque(T), "method": method}
    run = simulate(PENDULUM, x0=[0.5, 0.1], wrt=("J", "k", "d"), **options)
    assert run.wrt == ("J", "k", "d", "phi(0)", "omega(0)")
    for j, name in enumerate(run.wrt):
        numeric = by_differences(PENDULUM, name, 1e-6, x0=[0.5, 0.1], **options)
        assert run.sensitivities[:, :, j] == pytest.approx(numeric, rel=1e-5, abs=1e-6), name


def test_values_do_not_depend_on_whether_sensitivities_are_asked_for():
    plain = simulate(PENDULUM, T, torque(T), [0.5, 0.1])
    with_them = simulate(PENDULUM, T, torque(T), [0.5, 0.1], wrt=("k",))
    assert plain.x == pytest.approx(with_them.x, abs=1e-13)


@pytest.mark.parametrize(("level", "sticks"), [(0.2, False), (0.5, True)])
def test_sensitivities_through_stick_and_slip(level, sticks):
    rubbing = PENDULUM + effects.CoulombFriction("omega", level=level)
    name = effects.CoulombFriction("omega").names()["level"]
    options = {"t": np.arange(0, 6, 0.01), "u": 0.9 * torque(np.arange(0, 6, 0.01)), "substeps": 4}
    run = simulate(rubbing, x0=[0.5, 0.1], wrt=("J", "k", name), **options)
    omega = run.x[:, 1]
    assert (omega == 0).any() == sticks
    assert (np.diff(np.sign(omega)) != 0).sum() > 3
    for j, parameter in enumerate(run.wrt):
        numeric = by_differences(rubbing, parameter, 1e-6, x0=[0.5, 0.1], **options)
        size = np.abs(numeric).max()
        off = np.abs(run.sensitivities[:, :, j] - numeric).max(axis=1)
        # at the very sample of an event a difference quotient straddles it
        assert np.mean(off < 5e-3 * size) > 0.99, parameter


# -- dry friction ---------------------------------------------------------------------------------


def test_sliding_mass_stops_exactly_and_stays():
    t = np.arange(0, 5, 0.013)
    run = simulate(SLIDER, t, np.zeros(t.size), [1.0])
    v = run.x[:, 0]  # decelerates by 1 N / 2 kg, stops at 2 s
    assert v == pytest.approx(np.maximum(1 - 0.5 * t, 0), abs=1e-12)
    assert np.all(v[t > 2.0] == 0)


def test_stuck_below_the_level_and_away_above():
    t = np.arange(0, 4, 0.01)
    drive = 0.6 * t  # reaches 1 N at 5/3 s
    v = simulate(SLIDER, t, drive, [0.0], hold="foh", substeps=2).x[:, 0]
    assert np.all(v[t < 5 / 3] == 0)
    moving = t > 5 / 3
    assert np.all(v[moving][1:] > 0)
    assert v[moving] == pytest.approx(0.3 * (t[moving] - 5 / 3) ** 2 / 2, abs=0.01)


def test_breaks_away_in_either_direction():
    t = np.arange(0, 1, 0.01)
    forward = simulate(SLIDER, t, np.full(t.size, 1.5), [0.0]).x[:, 0]
    backward = simulate(SLIDER, t, np.full(t.size, -1.5), [0.0]).x[:, 0]
    assert forward == pytest.approx(0.25 * t, abs=1e-12)
    assert np.array_equal(backward, -forward)


def test_dry_friction_never_gives_energy():
    rubbing = PENDULUM.with_parameters(d=0.0) + effects.CoulombFriction("omega", level=0.3)
    run = simulate(rubbing, np.arange(0, 20, 0.01), np.zeros(2000), [2.5, 0.0])
    phi, omega = run.x.T
    energy = 0.15 * omega**2 / 2 + 2.4 * (1 - np.cos(phi))
    assert np.all(np.diff(energy) < 1e-6)
    assert np.all(run.x[-100:, 1] == 0)


def test_finer_steps_change_friction_little():
    rubbing = PENDULUM + effects.CoulombFriction("omega", level=0.4)
    coarse = simulate(rubbing, T, torque(T), [0.5, 0.0]).x[:, 0]
    fine = simulate(rubbing, T, torque(T), [0.5, 0.0], substeps=20).x[:, 0]
    assert coarse == pytest.approx(fine, abs=1e-4)


# -- failing solves -------------------------------------------------------------------------------

RUNAWAY = PhysicsModel({"x": "m"}, {"x": "k*x**2"}, {"k": 1.0}, name="runaway")


def test_divergence_is_told_with_place_time_and_remedy():
    t = np.linspace(0, 2, 41)  # x = 1/(1 - t)
    with pytest.warns(SimulationWarning) as caught:
        run = simulate(RUNAWAY, t, x0=[1.0])
    message = str(caught[0].message)
    first = int(np.flatnonzero(np.isnan(run.x[:, 0]))[0])
    assert message == run.message
    assert not run.success
    assert "'runaway' became non-finite" in message
    assert f"at t = {t[first]:g} s (sample {first}; before: x = " in message
    assert "Remedy: raise substeps (now 32)" in message
    assert np.isfinite(run.x[:first]).all()
    assert np.isnan(run.x[first:]).all()
    assert np.isnan(run.y[first:]).all()
    with pytest.raises(SimulationError, match="Remedy"):
        run.check()


def test_whole_solve_passes_its_own_check():
    run = simulate(LAG, T, np.ones(T.size))
    assert run.check() is run
    assert run.message == ""


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"t": [0.0, 0.2, 0.1]}, "t: expected increasing times, got 0.2 s then 0.1 s at sample 2."),
        ({"t": [0.0, np.nan, 1.0]}, "t: expected finite times, got nan at sample 1. Remedy: "),
        ({"t": [0.0, 1.0, np.inf]}, "t: expected finite times, got inf at sample 2. Remedy: "),
        ({"t": [[0.0, 1.0, 2.0]]}, "t: expected finite times of shape (n_samples,)"),
        ({"u": [1.0, 2.0]}, "u: expected shape (3, 1), got (2, 1)."),
        ({"u": None}, "u: expected shape (3, 1), got ()."),
        ({"u": [1.0, np.inf, 2.0]}, "u: 'u' is not finite at sample 1."),
        ({"x0": [1.0, 2.0]}, "x0: expected 1 finite numbers, got [1. 2.]."),
        ({"x0": [np.nan]}, "x0: expected 1 finite numbers"),
        ({"method": "heun"}, "method: expected one of euler, rk4, rosenbrock, got 'heun'."),
        ({"hold": "none"}, "hold: expected one of zoh, foh, got 'none'."),
        ({"substeps": 0}, "substeps: expected an integer >= 1, got 0."),
        ({"substeps": 1.5}, "substeps: expected an integer >= 1, got 1.5."),
        ({"substeps": True}, "substeps: expected an integer >= 1, got True."),
        ({"wrt": ("K",)}, "wrt: unknown parameter 'K'."),
    ],
)
def test_bad_arguments_are_named(change, text):
    arguments = {"t": [0.0, 0.1, 0.2], "u": [1.0, 1.0, 1.0], **change}
    with pytest.raises(ValueError) as error:  # noqa: PT011 - the whole text is compared
        simulate(LAG, **arguments)
    assert text in str(error.value)


def test_arguments_are_not_changed():
    t, u, x0 = T.copy(), torque(T)[:, None], np.array([0.5, 0.1])
    kept = t.copy(), u.copy(), x0.copy()
    simulate(PENDULUM + effects.InputDelay("M", delay=0.03), t, u, x0, wrt=("k",))
    for now, before in zip((t, u, x0), kept, strict=True):
        assert np.array_equal(now, before)


def test_a_gap_is_stepped_through_as_its_samples_would_be():
    stiff = PhysicsModel({"x": "", "v": ""}, {"x": "v", "v": "u - 400*x - 2*v"}, {}, {"u": ""})
    t = np.arange(0, 20, 0.02)
    u = np.where(t < 4, np.sin(3 * t), np.sin(3 * t[200]))  # held in the gap, and behind it
    seen = (t <= t[200]) | (t > 14)
    whole, gappy = simulate(stiff, t, u), simulate(stiff, t[seen], u[seen])
    assert gappy.success
    assert gappy.y[:, 0] == pytest.approx(whole.y[seen, 0], abs=1e-9)


# -- other processes ------------------------------------------------------------------------------

SCRIPT = """
import pickle, sys
import numpy as np
from sklearn_pgnn.simulation.hidden_input import find_hidden_input
from sklearn_pgnn.simulation.windows import evaluate
(model, t, u, x0), windows, x = pickle.load(open(sys.argv[1], "rb"))
wrt = tuple(model.parameters)
run = model.simulate(t, u, x0, wrt=wrt)
over_windows = evaluate(model, windows, x[windows.starts], wrt)
hidden = find_hidden_input(model, windows, "omega", x, np.ones(2), size=1.0, time=1.0)
np.savez(
    sys.argv[2], x=run.x, s=run.sensitivities, gram=over_windows.block_gram,
    residual=over_windows.residual, hidden=hidden.values, errors=hidden.errors,
)
"""


@pytest.mark.slow
@pytest.mark.parametrize("plain_calls", ["0", "1"], ids=["by address", "by numba's objects"])
def test_pickled_model_gives_the_same_bits_in_another_process(tmp_path, plain_calls):
    model = PENDULUM + effects.CoulombFriction("omega", level=0.3)
    arguments = model, T, torque(T), np.array([0.5, 0.0])
    y = simulate(*arguments).y + 1e-3 * np.random.default_rng(0).normal(size=(T.size, 2))
    records = read_records(model, np.column_stack([T, torque(T)]), y)
    windowed = window_records(model, records, window_length=0.5)
    windows, x = windowed.windows, windowed.states.estimate(model).x
    (tmp_path / "model.pickle").write_bytes(pickle.dumps((arguments, windows, x)))
    path = os.pathsep.join([str(Path(sklearn_pgnn.__file__).parents[1]), *sys.path])
    subprocess.run(
        [sys.executable, "-c", SCRIPT, tmp_path / "model.pickle", tmp_path / "result.npz"],
        env={**os.environ, "PYTHONPATH": path, "SKLEARN_PGNN_PLAIN_CALLS": plain_calls},
        check=True,
    )
    result, wrt = np.load(tmp_path / "result.npz"), tuple(model.parameters)
    here = simulate(*arguments, wrt=wrt)
    assert np.array_equal(result["x"], here.x)
    assert np.array_equal(result["s"], here.sensitivities)
    over_windows = evaluate(model, windows, x[windows.starts], wrt)
    assert np.array_equal(result["gram"], over_windows.block_gram)
    assert np.array_equal(result["residual"], over_windows.residual, equal_nan=True)
    hidden = find_hidden_input(model, windows, "omega", x, np.ones(2), size=1.0, time=1.0)
    assert np.isfinite(hidden.values).all()  # by the Kalman filter and the smoother
    assert np.array_equal(result["hidden"], hidden.values)
    assert np.array_equal(result["errors"], hidden.errors)


# -- machine code ---------------------------------------------------------------------------------

EXPRESSIONS = (
    *(f"{name}(0.3*u)" for name in FUNCTIONS if name not in {"atan2", "min", "max"}),
    "atan2(u, 0.5)",
    "min(u, 0.5, -u)",
    "max(u, 0.5, -u)",
    "1/u + u**2 - u**-3 + abs(u)**1.7 + u**5",
    "sign(u)*sqrt(abs(u)) - pi",
)


@pytest.mark.parametrize("text", EXPRESSIONS)
def test_machine_code_computes_what_the_expression_says(text):
    model = PhysicsModel({"x": ""}, {"x": "-x"}, {}, {"u": ""}, {"y": text})
    u = np.array([-2.3, -1.0, -0.2, 0.2, 0.9, 1.0, 2.7])
    values = [complex(model.outputs["y"].subs(symbol("u"), value).evalf()) for value in u]
    real = np.abs(np.imag(values)) < 1e-12
    y = simulate(model, np.arange(real.sum()), u[real], [0.0]).y[:, 0]
    np.testing.assert_allclose(y, np.real(values)[real], rtol=1e-12, atol=1e-12)


# -- windows --------------------------------------------------------------------------------------


def windowed_records(model, noise=1e-3, seed=0, window_length=None):
    """Cut a noisy record of the pendulum into windows."""
    t = np.arange(0, 20, 0.02)
    rng = np.random.default_rng(seed)
    truth = PENDULUM.with_parameters(J=0.16, k=2.3, d=0.03)
    y = simulate(truth, t, torque(t), [0.2, 0.0], substeps=4).y
    table = np.column_stack([t, torque(t)])
    records = read_records(model, table, y + noise * rng.standard_normal(y.shape))
    return truth, window_records(model, records, window_length=window_length, substeps=4)


def fitted(windowed, model=PENDULUM):
    """Fit the pendulum's parameters; give the fit and what the initial states were expected."""
    estimate = windowed.states.estimate(model)
    expected = estimate.x[windowed.windows.starts]
    free = tuple(ParameterPrior(name, 1e-3, 10.0, 1.0, np.inf, 1.0) for name in ("J", "k", "d"))
    fit = fit_windows(
        model, windowed.windows, free, expected, estimate.spread, max_steps=50, tolerance=1e-12
    )
    return fit, expected, estimate.spread


def test_slope_of_a_bounded_rate_is_evaluated_at_samples_beside_numbers():
    bounded = systems.servo_valve(limits=True).equations["y"]
    slope = sympy.diff(bounded, symbol("v_max"))
    v = np.array([-3.0, -1.0, 0.0, 1.0, 3.0])
    assert evaluate_samples(slope, {"v": v, "v_max": 2.0}, 5).tolist() == [-1, 0, 0, 0, 1]


def test_gradient_of_windows_is_the_derivative_of_their_squares():
    _, windowed = windowed_records(PENDULUM)
    x0 = windowed.states.estimate(PENDULUM).x[windowed.windows.starts]

    def squares(**values):
        return evaluate(PENDULUM.with_parameters(**values), windowed.windows, x0, ()).squares.sum()

    gram = evaluate(PENDULUM, windowed.windows, x0, ("J", "k", "d")).gram
    for j, name in enumerate(("J", "k", "d")):
        value, step = PENDULUM.parameters[name].value, 1e-6
        slope = squares(**{name: value + step}) - squares(**{name: value - step})
        assert -2 * gram[:, j, -1].sum() == pytest.approx(slope / (2 * step), rel=1e-4)


def test_a_window_whose_outputs_are_made_of_rounding_is_lost():
    """In too large steps outputs may stay in range while their slopes grow to 1e135."""
    model = PhysicsModel({"y": "V"}, {"y": "sin(c*y) + b*u"}, {"c": 1638.0, "b": 1.0}, {"u": "V"})
    t = np.arange(0, 8, 0.1)
    records = read_records(model, np.column_stack([t, np.sin(t)]), np.sin(t)[:, None])
    windows = window_records(model, records, window_length="trajectory").windows
    windows, steps = replace(windows, method="rk4", substeps=1), {"method": "rk4"}
    # the last digit of the initial state decides what is simulated
    runs = [model.simulate(t, np.sin(t), [x0], **steps).y for x0 in (1.0, 1.0 + 1e-15)]
    assert np.abs(runs[0] - runs[1]).max() > 10 * windows.scale
    found = evaluate(model, windows, np.ones((1, 1)), ("c", "b"))
    assert found.squares.tolist() == [np.inf]
    assert not found.gram[:, :-1].any()


def test_a_tank_that_was_empty_does_not_hide_the_slopes():
    """The slope of a root at its bound is 0, not 0/0, and so the windows keep their gradient."""
    tanks, t = systems.two_tanks(), np.arange(0, 100, 1.0)
    pump = np.where(t < 20, 0.0, 2.0)
    names, x0 = tuple(tanks.free_parameters), [0.0, 4.0]
    run = tanks.simulate(t, pump, x0, substeps=4, wrt=names)
    assert np.all(np.isfinite(run.sensitivities))
    for j, name in enumerate(names):
        step = 1e-6 * tanks.parameters[name].value
        values = [tanks.parameters[name].value + s for s in (step, -step)]
        up, down = (
            tanks.with_parameters(**{name: v}).simulate(t, pump, x0, substeps=4).y for v in values
        )
        slope = (up - down) / (2 * step)
        np.testing.assert_allclose(run.sensitivities[:, :, j], slope, rtol=1e-2, atol=1e-3)


def test_window_fit_ends_where_the_gradient_vanishes():
    truth, windowed = windowed_records(PENDULUM)
    fit, expected, spread = fitted(windowed)
    normal = project(fit.evaluation.gram, 3, spread**-2.0, fit.x0 - expected)
    # Newton's decrement: what a further step could still gain, of some 2000 squares
    gradient, hessian = normal.gradient.sum(axis=0), normal.hessian.sum(axis=0)
    assert gradient @ np.linalg.solve(hessian, gradient) < 1e-6 * fit.squares
    state_gradient = fit.evaluation.gram[:, 3:5, 5] - (fit.x0 - expected) / spread**2
    scale = np.sqrt(np.einsum("wii->wi", fit.evaluation.gram[:, 3:5, 3:5]))
    assert np.abs(state_gradient / scale).max() < 1e-2
    assert fit.squares == pytest.approx(np.isfinite(windowed.windows.y).sum(), rel=0.2)
    errors = standard_errors(fit, expected, spread)
    for name, error in errors.items():
        assert abs(fit.model.parameters[name].value - truth.parameters[name].value) < 4 * error


def test_windows_give_the_same_on_several_threads():
    _, windowed = windowed_records(PENDULUM)
    x0 = windowed.states.estimate(PENDULUM).x[windowed.windows.starts]
    one = evaluate(PENDULUM, windowed.windows, x0, ("J",))
    three = evaluate(PENDULUM, replace(windowed.windows, threads=3), x0, ("J",))
    assert np.array_equal(one.gram, three.gram)
    assert np.array_equal(one.residual, three.residual)


def test_a_fit_that_is_told_to_end_keeps_its_steps():
    """Two steps from values that are near bring it most of the way."""
    _, windowed = windowed_records(PENDULUM)
    estimate, told = windowed.states.estimate(PENDULUM), []
    free = (ParameterPrior("k", 1.0, 3.0, 2.4, np.inf, 1.0),)
    given = windowed.windows, free, estimate.x[windowed.windows.starts], estimate.spread
    whole, none = fit_windows(PENDULUM, *given), fit_windows(PENDULUM, *given, max_steps=0)
    ended = fit_windows(PENDULUM, *given, each_step=lambda: told.append(1) or True)
    assert len(told) == 1 + 3  # before the start is evaluated, before two steps, and at the end
    assert ended.objective - whole.objective < 0.1 * (none.objective - whole.objective)


def test_fit_respects_bounds():
    _, windowed = windowed_records(PENDULUM)
    estimate = windowed.states.estimate(PENDULUM)
    free = (ParameterPrior("k", 2.35, 3.0, 2.4, np.inf, 1.0),)
    start = estimate.x[windowed.windows.starts]
    fit = fit_windows(PENDULUM, windowed.windows, free, start, estimate.spread)
    assert fit.values[0] == 2.35  # the truth, 2.3, is out of bounds


@pytest.mark.parametrize(
    ("low", "value", "high", "beside"),
    [(0, 1, 9, 2), (0, 8, 8.5, 7), (0, 0, 0.5, 0.5), (0, 0.4, 0.5, 0), (-np.inf, 3, 3, 2)],
)
def test_the_value_beside_another_lies_within_the_bounds(low, value, high, beside):
    assert ParameterPrior("k", low, high, 0.0, np.inf, 1.0).beside(value, 1.0) == beside


def test_a_window_that_diverges_from_its_start_begins_where_it_is_expected():
    _, windowed = windowed_records(PENDULUM)
    estimate = windowed.states.estimate(PENDULUM)
    expected = estimate.x[windowed.windows.starts]
    begun = expected.copy()
    begun[3] = np.inf
    fit = fit_windows(PENDULUM, windowed.windows, (), expected, estimate.spread, x0_start=begun)
    usual = fit_windows(PENDULUM, windowed.windows, (), expected, estimate.spread)
    assert fit.squares == pytest.approx(usual.squares, rel=1e-3)


def test_a_promise_of_more_than_is_left_counts_for_nothing():
    _, windowed = windowed_records(PENDULUM)
    best, expected, spread = fitted(windowed)
    near = best.model.with_parameters(k=1.01 * best.model.parameters["k"].value)
    fit = fit_windows(near, windowed.windows, best.freedoms, expected, spread, max_steps=0)
    promised = expected_decrease(fit, windowed.windows, expected, spread)
    assert promised == pytest.approx(fit.objective - best.objective, rel=0.05)
    gram = fit.evaluation.block_gram.copy()
    gram[..., :-1, :-1] *= 1e-9  # as if rounding had left next to nothing of the curvature
    lost = replace(fit, evaluation=replace(fit.evaluation, block_gram=gram))
    assert expected_decrease(lost, windowed.windows, expected, spread) == 0.0


def test_standard_errors_are_those_of_repeated_experiments():
    truth, windowed = windowed_records(PENDULUM)
    windows, rng = windowed.windows, np.random.default_rng(1)
    clean = simulate(truth, windows.t, windows.u, [0.2, 0.0], substeps=4).y
    found, claimed = [], []
    for _ in range(30):
        y = clean + 1e-3 * rng.standard_normal(clean.shape)
        fit, *start = fitted(replace(windowed, windows=replace(windows, y=y)))
        found.append(fit.values)
        claimed.append(list(standard_errors(fit, *start).values()))
    ratio = np.median(claimed, axis=0) / np.std(found, axis=0)
    assert np.all((ratio > 0.6) & (ratio < 1.6))
    truths = [truth.parameters[name].value for name in "Jkd"]
    assert np.mean(np.abs(np.array(found) - truths) < 1.96 * np.array(claimed)) > 0.85


def test_parameters_seen_only_together_have_no_finite_error():
    twice = PhysicsModel(
        {"y": "V"}, {"y": "a*b*u - c*y"},
        [Parameter("a", 1.0), Parameter("b", 1.0), Parameter("c", 0.5)], {"u": "V"},
    )  # fmt: skip
    t = np.arange(0, 20, 0.05)
    u = np.sin(t) + np.sin(3.1 * t)
    y = simulate(twice, t, u).y + 1e-3 * np.random.default_rng(0).standard_normal((t.size, 1))
    windowed = window_records(twice, read_records(twice, np.column_stack([t, u]), y))
    estimate = windowed.states.estimate(twice)
    expected = estimate.x[windowed.windows.starts]
    free = tuple(ParameterPrior(name, 0.01, 10, 1.0, np.inf, 1.0) for name in "abc")
    fit = fit_windows(twice, windowed.windows, free, expected, estimate.spread)
    errors = standard_errors(fit, expected, estimate.spread)
    assert np.isinf([errors["a"], errors["b"]]).all()
    assert 0 < errors["c"] < 0.05


@pytest.mark.filterwarnings("error")
def test_a_parameter_beyond_all_numbers_that_does_not_act_does_no_harm():
    _, windowed = windowed_records(PENDULUM)
    estimate = windowed.states.estimate(PENDULUM)
    expected = estimate.x[windowed.windows.starts]
    begun = PENDULUM.replace(parameters=[*PENDULUM.parameters.values(), Parameter("b", 1e200)])
    free = (ParameterPrior("b", -np.inf, np.inf, 1.0, np.inf, 1.0),)
    fit = fit_windows(begun, windowed.windows, free, expected, estimate.spread, max_steps=0)
    without = fit_windows(PENDULUM, windowed.windows, (), expected, estimate.spread, max_steps=0)
    assert fit.objective == pytest.approx(without.objective)


@pytest.mark.filterwarnings("error")
def test_a_state_that_runs_away_unseen_is_taken_to_stay_at_its_start():
    # large enough that its square is no number any more, but a number itself
    runaway = PhysicsModel(
        {"y": "V", "z": "V"}, {"y": "-y", "z": "g*z + 1"}, {"g": 1.0}, outputs={"y": "y"}
    )
    t = np.arange(0, 4, 0.1)
    windowed = window_records(runaway, read_records(runaway, t[:, None], np.exp(-t)), substeps=20)
    estimate = windowed.states.estimate(runaway.with_parameters(g=120.0))
    assert np.isfinite(estimate.spread).all()
    assert np.abs(estimate.x[:, 1]).max() < 1e100
