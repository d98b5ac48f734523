"""Effects of machine parts, hidden in machines that are written out by hand, are named.

Each has its nearest relatives beside it in the catalogue; without it, nothing is named. The numbers
of every machine are drawn.
"""

import numpy as np
import pytest
from mechanisms import integrate, tables, waves

from sklearn_pgnn import ModelDiagnosis, PhysicsModel

NOISE = 2e-3
INF = float("inf")


def near(value, rng, **about):
    """Return a parameter that is up to 5 % off, or unknown with ``spread=inf``."""
    return {"value": value * (1 + 0.05 * rng.uniform(-1, 1)), **about}


def noisy(y, rng):
    return y + NOISE * y.std() * rng.normal(size=y.shape)


def sprung_mass(rng, hides, loss=0.0, bend=0.0):
    """A mass on a spring, whose springs are linear, or of which one is hysteretic."""
    m, d, k = rng.uniform(1, 3), rng.uniform(5, 10), rng.uniform(2e3, 4e3)
    t = np.arange(1000) * 2e-3
    F = 60 * waves(t, rng, 3, [3.1, 5.3, 7.7, 11.3, 15.1])

    def rates(x, u):
        q, v, z = x
        bent = 1.5e3 * v - loss * abs(v) * z - bend * v * abs(z)
        return v, (u - k * q - d * v - z) / m, hides * bent

    q = integrate(rates, np.zeros((3, 3)), t, F)[0]
    about = {"unit": "N/m", "spread": INF}
    model = PhysicsModel(
        {"x": "m", "v": "m/s"},
        {"x": "v", "v": "(F - d*v - k*x)/m"},
        {"m": near(m, rng, unit="kg"), "d": near(d, rng, spread=INF), "k": near(k, rng, **about)},
        {"F": "N"},
        {"y": "x"},
        inertia={"v": "m"},
    )
    return model, *tables(t, {"F": F}, {"y": noisy(q, rng)})


SPRINGS = "hysteretic_spring", "hysteresis", "cubic_stiffness", "quadratic_drag", "coulomb_friction"


def axis(rng, hides, backward=0.0, share=0.0, peak=0.0):
    """An axis with a weight on a lever, of known inertia, whose gear loses by the load."""
    J, d, G = 0.05, rng.uniform(0.02, 0.05), rng.uniform(0.3, 0.5)
    level, vs = 0.03, 0.15
    t = np.arange(500) * 0.02
    tau = 0.9 * waves(t, rng, 4, [0.23, 0.41, 0.77])

    def rates(x, u):
        q, w = x
        driven = np.where(u * w > 0, share, backward) if hides else 0.0
        slow = 1 + peak * np.exp(-((w / vs) ** 2)) * hides
        loss = (hides * level + driven * abs(u)) * slow * np.tanh(w / 2e-3)
        return w, (u - d * w - G * np.sin(q) - loss) / J

    q = integrate(rates, np.zeros((2, 4)), t, tau, steps=60)[0]
    model = PhysicsModel(
        {"q": "rad", "w": "rad/s"},
        {"q": "w", "w": "(tau - d*w - G*sin(q))/J"},
        {
            "J": {"value": J, "unit": "kg m^2", "fixed": True},
            "d": near(d, rng, unit="N m s/rad"),
            "G": {"value": G, "unit": "N m", "fixed": True},
        },
        {"tau": "N m"},
        {"angle": "q"},
        inertia={"w": "J"},
    )
    return model, *tables(t, {"tau": tau}, {"angle": noisy(q, rng)})


LOSSES = "gear_loss", "load_friction", "coulomb_friction", "asymmetric_friction", "input_gain"
PEAKS = "load_stribeck_friction", "stribeck_friction", "load_friction", "coulomb_friction"


def servo(rng, hides, gap=0.0):
    """A motor with a load, rigid or behind an elastic shaft, that may have play."""
    J, d, share = rng.uniform(0.01, 0.02), rng.uniform(0.03, 0.06), rng.uniform(0.3, 0.6)
    k = share * (1 - share) * J * (2 * np.pi * rng.uniform(4, 8)) ** 2
    damping = 0.03 * k / 20
    t = np.arange(800) * 5e-3
    tau = 0.4 * waves(t, rng, 4, [0.7, 1.9, 3.7, 6.1, 9.3])

    def rates(x, u):
        _, w, twist, load = x
        flank = np.sign(twist) * np.maximum(abs(twist) - gap / 2, 0)
        T = k * flank + damping * (w - load)
        if not hides:
            return w, (u - d * w) / J, 0 * w, 0 * w
        return w, (u - d * w - T) / (J * (1 - share)), w - load, T / (J * share)

    q = integrate(rates, np.zeros((4, 4)), t, tau, steps=16)[0]
    model = PhysicsModel(
        {"q": "rad", "w": "rad/s"},
        {"q": "w", "w": "(tau - d*w)/J"},
        {"J": near(J, rng, unit="kg m^2"), "d": near(d, rng, unit="N m s/rad", spread=INF)},
        {"tau": "N m"},
        {"angle": "q"},
        inertia={"w": "J"},
    )
    return model, *tables(t, {"tau": tau}, {"angle": noisy(q, rng)})


BEHIND = "actuator_lag", "linear_stiffness", "hysteretic_spring"


def two_inertias(rng, hides):
    """Two inertias on a shaft, which may have play; both angles are measured."""
    J1, J2, k, c = 0.01, rng.uniform(0.02, 0.04), rng.uniform(20, 40), rng.uniform(0.02, 0.05)
    gap = hides * rng.uniform(0.02, 0.05)
    t = np.arange(800) * 4e-3
    tau = 1.5 * waves(t, rng, 4, [0.9, 2.3, 4.1, 6.7])

    def rates(x, u):
        a, b, v, w = x
        T = k * np.sign(a - b) * np.maximum(abs(a - b) - gap / 2, 0) + c * (v - w)
        return v, w, (u - 0.02 * v - T) / J1, (T - 0.02 * w) / J2

    x = integrate(rates, np.zeros((4, 4)), t, tau, steps=16)
    model = PhysicsModel(
        {"a": "rad", "b": "rad", "v": "rad/s", "w": "rad/s"},
        {
            "a": "v",
            "b": "w",
            "v": "(tau - d*v - k*(a - b) - c*(v - w))/J1",
            "w": "(k*(a - b) + c*(v - w) - d*w)/J2",
        },
        {
            "J1": near(J1, rng, unit="kg m^2"),
            "J2": near(J2, rng, unit="kg m^2"),
            "k": near(k, rng, unit="N m/rad"),
            "c": near(c, rng, unit="N m s/rad"),
            "d": {"value": 0.02, "unit": "N m s/rad"},
        },
        {"tau": "N m"},
        {"motor": "a", "load": "b"},
        inertia={"v": "J1", "w": "J2"},
    )
    y = {"motor": noisy(x[0], rng), "load": noisy(x[1], rng)}
    return model, *tables(t, {"tau": tau}, y)


PLAYS = "spring_play", "input_backlash", "coulomb_friction", "cubic_stiffness"


def dial(rng, hides, output="q", scale=1.0, weight=1.0):
    """A pendulum that swings far, or a rotor, whose sensor may sit off centre."""
    w0, d = weight * rng.uniform(3, 4), rng.uniform(0.1, 0.2)
    a, b = hides * rng.uniform(0.03, 0.06), hides * rng.uniform(-0.05, 0.05)
    t = np.arange(500) * 0.02

    def rates(x, u):
        q, w = x
        return w, -(w0**2) * np.sin(q) - d * w + u

    u = 4 * waves(t, rng, 4, [0.31, 0.57])
    x0 = np.array([[2.5, -2.2, 1.4, -2.7], [0.0, 1.0, 0.0, 2.0]])
    q = integrate(rates, x0, t, u)[0]
    model = PhysicsModel(
        {"q": "rad", "w": "rad/s"},
        {"q": "w", "w": "u - a*sin(q) - d*w"},
        {"a": near(w0**2, rng), "d": near(d, rng, spread=INF)},
        {"u": "rad/s^2"},
        {"angle": output},
    )
    seen = scale * noisy(q + a * np.sin(q) + b * np.cos(q), rng)
    return model, *tables(t, {"u": u}, {"angle": seen})


DIALS = "sensor_eccentricity", "sensor_curvature", "sensor_gain", "sensor_bias", "quadratic_drag"


def car(rng, hides, zone=0.0):
    """A car whose motor gives less force at speed, perhaps behind a dead zone."""
    m, k, d = rng.uniform(1.2, 2.0), rng.uniform(12, 20), rng.uniform(0.5, 1.0)
    f = hides * rng.uniform(0.12, 0.2)
    t = np.arange(400) * 0.05
    u = np.abs(0.9 * waves(t, rng, 4, [0.053, 0.17, 0.31]))

    def rates(x, u):
        (v,) = x
        force = k * np.maximum(u - zone, 0) * (1 - f * abs(v))
        return ((force - d * v - 0.8 * np.tanh(v / 1e-2)) / m,)

    v = integrate(rates, np.zeros((1, 4)), t, u)[0]
    model = PhysicsModel(
        {"v": "m/s"},
        {"v": "(k*u - d*v - Fc*sign(v))/m"},
        {
            "m": {"value": m, "unit": "kg", "fixed": True},
            "k": near(k, rng, unit="N", spread=INF),
            "d": near(d, rng, unit="N s/m", spread=INF),
            "Fc": {"value": 0.8, "unit": "N", "fixed": True},
        },
        {"u": "1"},
        {"speed": "v"},
        inertia={"v": "m"},
    )
    return model, *tables(t, {"u": u}, {"speed": noisy(v, rng)})


DRIVES = "input_fading", "quadratic_drag", "input_saturation", "input_gain", "parameter_saturation"

#: by name: the machine, what it hides, and the catalogue, of which the first is hidden
CASES = {
    "hardening": (sprung_mass, {"loss": 120.0, "bend": -180.0}, SPRINGS),
    "softening": (sprung_mass, {"loss": 145.0, "bend": -105.0}, SPRINGS),
    "levels off": (sprung_mass, {"loss": 60.0, "bend": 90.0}, ("hysteresis", *SPRINGS)),
    "gear": (axis, {"share": 0.05, "backward": 0.5}, LOSSES),
    "slow gear": (axis, {"share": 0.15, "backward": 0.15, "peak": 1.0}, PEAKS),
    "elastic": (servo, {}, ("elastic_joint", "joint_play", *BEHIND)),
    "play": (servo, {"gap": 0.1}, ("joint_play", "elastic_joint", *BEHIND)),
    "shaft": (two_inertias, {}, PLAYS),
    "encoder": (dial, {}, DIALS),
    "counts": (dial, {"output": "1000*q", "scale": 1000.0, "weight": 0.0}, DIALS),
    "car": (car, {}, DRIVES),
    "zone": (car, {"zone": 0.15}, (*DRIVES, "input_dead_zone")),
}


def diagnose(name, hides, seed=0):
    machine, options, catalogue = CASES[name]
    model, X, y = machine(np.random.default_rng(seed), hides, **options)
    return ModelDiagnosis(model, catalogue=list(catalogue), n_jobs=1).fit(X, y)


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_what_is_hidden_is_named(name):
    found = diagnose(name, True)
    hidden = CASES[name][2][0]
    assert hidden in [cause.effect for cause in found.causes_], (found.causes_, found.verdict_)
    others = {"input_dead_zone"} if name == "zone" else set()
    assert {cause.effect for cause in found.causes_} == {hidden, *others}
    assert found.verdict_ == "cause_named"


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_nothing_is_named_where_nothing_is_hidden(name):
    found = diagnose(name, False)
    hidden = CASES[name][2][0]
    assert hidden not in [cause.effect for cause in found.causes_]
