"""Several dry frictions at once: exact solutions, rounded-off references, sensitivities."""

import numpy as np
import pytest
import sympy
from rubbing_machines import cart_pendulum, stacked_blocks, two_link_arm
from scipy.integrate import solve_ivp

from sklearn_pgnn import PhysicsModel
from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.dry_friction import dry_friction
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.simulation.simulate import simulate
from sklearn_pgnn.simulation.source import write_source


def clock(end, step=0.01):
    return np.arange(0, end + step / 2, step)


# -- which flows are under dry friction ------------------------------------------------------------


def test_signs_of_one_flow_are_one_sign_whichever_way_it_is_counted():
    rates = {"a": "-F*sign(2*a - 2*b)", "b": "-F*sign(b - a) - F*sign(b)"}
    dry = dry_friction(PhysicsModel(dict.fromkeys(rates, ""), rates, {"F": 1.0}))
    assert [str(flow) for flow in dry.flows] == ["b", "a - b"]
    assert len(dry.signs) == 3
    assert set(dry.signs.values()) == {dry.symbols[0], dry.symbols[1], -dry.symbols[1]}


def test_a_sign_that_does_not_act_on_its_own_rate_is_no_dry_friction():
    rates = {"q": "v", "v": "-k*sign(q)", "T": "F*v*sign(v)"}
    assert not dry_friction(PhysicsModel(dict.fromkeys(rates, ""), rates, {"k": 1, "F": 1})).rows


def test_a_product_of_two_frictions_directions_is_refused():
    rates = {"a": "-F*sign(a)*sign(b)", "b": "-F*sign(b)"}
    with pytest.raises(ModelError, match=r"rate of 'a' contains a product.*Remedy: write them as"):
        write_source(PhysicsModel(dict.fromkeys(rates, ""), rates, {"F": 1.0}))


def test_a_friction_that_is_not_linear_in_the_sign_mixes_both_sides():
    rates = {"v": "u - F*(2 + sign(v))**2*sign(v)"}  # 9 F forward, F backward
    model = PhysicsModel({"v": "m/s"}, rates, {"F": 1.0}, {"u": ""})
    t = clock(1.0)
    for u, rate in ((8.9, 0), (9.5, 0.5), (-0.9, 0), (-1.5, -0.5)):
        v = simulate(model, t, np.full(t.size, u), [0.0]).x[:, 0]
        np.testing.assert_allclose(v, rate * t, atol=1e-12)


# -- exact solutions -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("u", "F", "G", "expected"),
    [
        (0.9, 3.0, 1.0, (0.0, 0.0)),  # the ground holds both
        (-2.5, 3.0, 1.0, (-0.5, -0.5)),  # together
        (6.0, 3.0, 1.0, (3.0, 1.0)),  # apart
        (4.0, 3.0, 3.5, (1.0, 0.0)),  # the upper one alone
    ],
)
def test_blocks_leave_rest_together_apart_or_not_at_all(u, F, G, expected):
    t = clock(2.0)
    x = simulate(stacked_blocks(F=F, G=G), t, np.full(t.size, u), [0.0, 0.0], substeps=1).x
    np.testing.assert_allclose(x, np.outer(t, expected), atol=1e-12)


def test_sliding_blocks_come_to_rest_one_on_the_other_and_then_on_the_ground():
    t = clock(4.0, 0.013)
    x = simulate(stacked_blocks(F=0.6, G=0.4), t, np.zeros(t.size), [2.0, 0.5], substeps=1).x
    # apart: -0.6 and (0.6 - 0.4)/2 m/s^2, until 2 - 0.6 t = 0.5 + 0.1 t
    meet = 1.5 / 0.7
    speed, fall = 2 - 0.6 * meet, 0.4 / 3  # together
    together = np.maximum(speed - fall * (t - meet), 0)
    np.testing.assert_allclose(x[:, 0], np.where(t < meet, 2 - 0.6 * t, together), atol=1e-12)
    np.testing.assert_allclose(x[:, 1], np.where(t < meet, 0.5 + 0.1 * t, together), atol=1e-12)


def test_a_cart_is_held_by_its_rail_while_the_pendulum_swings():
    """While it is, the pendulum is that on a fixed pivot, and the rail takes its force."""
    held, fixed = cart_pendulum(Fc=20.0, Fp=0.0), {"phi": "w", "w": "-g/l*sin(phi)"}
    t = clock(3.0)
    x = simulate(held, t, np.zeros(t.size), [0.1, 1.2, 0.0, 0.0], substeps=2).x
    pendulum = PhysicsModel({"phi": "", "w": ""}, fixed, {"g": 9.81, "l": 0.5})
    expected = simulate(pendulum, t, None, [1.2, 0.0], substeps=2).x
    np.testing.assert_allclose(x[:, [1, 3]], expected, atol=1e-11)
    assert np.all(x[:, 0] == 0.1)
    assert np.all(x[:, 2] == 0)


def test_an_arm_at_rest_stays_where_both_joints_can_hold_it_and_gives_way_where_not():
    gravity = np.array([6 * np.cos(0.4) + 1.5 * np.cos(0.9), 1.5 * np.cos(0.9)])
    t = clock(0.5)
    u = np.zeros((t.size, 2))
    for share, moves in ((0.999, False), (1.001, True)):
        hold = two_link_arm(F1=gravity[0] / share, F2=10.0)
        assert np.any(simulate(hold, t, u, [0.4, 0.5, 0, 0]).x[:, 2] != 0) == moves
        slips = two_link_arm(F1=50.0, F2=gravity[1] / share)
        w = simulate(slips, t, u, [0.4, 0.5, 0, 0]).x[:, 2:]
        assert np.all(w[:, 0] == 0)
        assert np.any(w[:, 1] != 0) == moves


def test_a_flow_breaks_away_inside_a_step_where_what_holds_it_is_at_its_limit():
    coarse, fine = (
        simulate(cart_pendulum(Fc=2.0), clock(3.0, 0.02), np.zeros(151), [0, 1.2, 0, 0], substeps=n)
        for n in (1, 64)
    )
    assert 0.05 < np.mean(fine.x[:, 2] == 0) < 0.95
    np.testing.assert_allclose(coarse.x, fine.x, atol=3e-5)


def test_stiff_steps_hold_what_sticks_as_explicit_ones_do():
    t = clock(2.0)
    u = np.where(t < 1, 3.0, -2.0)
    start = [0, 0.8, 0, 0]
    explicit = simulate(cart_pendulum(), t, u, start, substeps=4)
    stiff = simulate(cart_pendulum(), t, u, start, substeps=16, method="rosenbrock")
    np.testing.assert_allclose(stiff.x, explicit.x, atol=2e-5)
    assert np.array_equal(stiff.x[:, 2] == 0, explicit.x[:, 2] == 0)


# -- references with friction rounded off ----------------------------------------------------------


def rounded_off(model, t, u, x0, width=1e-6):
    """Return the states of a model whose signs are hyperbolic tangents, inputs held."""
    states, inputs = ([symbol(name) for name in part] for part in (model.states, model.inputs))
    values = {symbol(name): p.value for name, p in model.parameters.items()}
    rates = [
        rate.subs(values).replace(sympy.sign, lambda z: sympy.tanh(z / width))
        for rate in model.equations.values()
    ]
    rate = sympy.lambdify([states, inputs], rates, "math", cse=True)
    slopes = sympy.lambdify([states, inputs], sympy.Matrix(rates).jacobian(states), "numpy")
    x, u = [np.array(x0, dtype=float)], u.reshape(t.size, -1)
    starts = np.flatnonzero(np.r_[True, np.any(np.diff(u, axis=0) != 0, axis=1)])
    for a, b in zip(starts, [*starts[1:], t.size - 1], strict=True):
        run = solve_ivp(
            lambda _, x, u: rate(x, u), (t[a], t[b]), x[-1], "Radau", t[a + 1 : b + 1],
            args=(u[a],), jac=lambda _, x, u: slopes(x, u), rtol=1e-7, atol=1e-9,
        )  # fmt: skip
        x += [*run.y.T]
    return np.array(x)


def held(t, *levels):
    """Return an input that takes one level after the other."""
    return np.array(levels)[np.minimum((t / t[-1] * len(levels)).astype(int), len(levels) - 1)]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("model", "levels", "x0"),
    [
        (cart_pendulum(Fc=1.5, Fp=0.6), [0.0, 4.0, -2.0, 0.0], [0.0, 0.5, 0.0, 0.0]),
        (two_link_arm(), [[8, 1.5], [3, 2.5], [6.5, -1]], [0.3, -0.4, 0.0, 0.0]),
        (stacked_blocks(F=1.5), [4.0, 0.5, -2.5, 0.0], [0.0, 0.0]),
    ],
    ids=lambda each: getattr(each, "name", ""),
)
def test_friction_is_the_limit_of_friction_rounded_off(model, levels, x0):
    t = clock(3.0)
    u = held(t, *levels)
    x = simulate(model, t, u, x0, substeps=1).x
    flows = x @ np.array(dry_friction(model).rows).T
    at_rest = np.abs(flows) < 1e-12
    assert np.all(at_rest[1:].any(axis=0))
    assert np.all(~at_rest.all(axis=0))
    np.testing.assert_allclose(x, rounded_off(model, t, u, x0), atol=1e-4)


# -- sensitivities ---------------------------------------------------------------------------------


def by_differences(model, name, step, **options):
    value = model.parameters[name].value
    high, low = (
        simulate(model.with_parameters(**{name: value + d}), **options).y for d in (step, -step)
    )
    return (high - low) / (2 * step)


@pytest.mark.parametrize("scale", [0.8, 1.0, 1.25])
@pytest.mark.parametrize(
    ("machine", "values", "levels", "x0"),
    [
        (cart_pendulum, {"Fc": 1.5, "Fp": 0.6}, [0.0, 4.0, -2.0, 0.0], [0.0, 0.5, 0.0, 0.0]),
        (two_link_arm, {"F1": 2.0, "F2": 0.8}, [[8, 1.5], [3, 2.5], [6.5, -1]], [0.3, -0.4, 0, 0]),
        (stacked_blocks, {"F": 1.0, "G": 0.7}, [3.0, 0.5, -1.5, 0.0], [0.0, 0.0]),
    ],
    ids=["cart with pendulum", "arm", "blocks"],
)
def test_sensitivities_through_the_sticking_and_slipping_of_two(machine, values, levels, x0, scale):
    model = machine(**{name: scale * value for name, value in values.items()})
    t = clock(3.0)
    options = {"t": t, "u": held(t, *levels), "x0": x0, "substeps": 4}
    wrt = (*values, next(iter(model.parameters)))
    run = simulate(model, wrt=wrt, **options)
    flows = run.x @ np.array(dry_friction(model).rows).T
    assert np.all((np.abs(flows) < 1e-12)[1:].any(axis=0))
    for j, parameter in enumerate(wrt):
        numeric = by_differences(model, parameter, 1e-6, **options)
        off = np.abs(run.sensitivities[:, :, j] - numeric).max(axis=1)
        # at the very sample of an event a difference quotient straddles it
        assert np.mean(off < 5e-3 * np.abs(numeric).max()) > 0.98, parameter


def test_an_accelerometer_sees_nothing_of_what_sticks():
    rates = stacked_blocks().equations
    model = stacked_blocks().replace(outputs={"a1": rates["v1"], "a2": rates["v2"], "v": "v1"})
    t = clock(2.0)
    u = held(t, 0.5, -0.9, 2.0, 6.0)  # held, held, together, apart
    run = simulate(model, t, u, [0.0, 0.0], wrt=("F", "G", "m1"), substeps=1)
    expected = held(t, 0.0, 0.0, 1.0 / 3, 3.0), held(t, 0.0, 0.0, 1.0 / 3, 1.0)
    np.testing.assert_allclose(run.y[1:-1, :2], np.transpose(expected)[1:-1], atol=1e-12)
    by_levels = run.sensitivities[1:-1, 0, :3]
    # at rest nothing; together (u - G)/(m1 + m2); apart (u - F)/m1
    slopes = held(t, [0, 0, 0], [0, 0, 0], [0, -1 / 3, -1 / 9], [-1, 0, -3])
    np.testing.assert_allclose(by_levels, slopes[1:-1], atol=1e-10)
