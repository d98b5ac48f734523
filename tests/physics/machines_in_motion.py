"""Machines by their energies, and numbers to put into their equations."""

import numpy as np
import sympy

from sklearn_pgnn.physics import PhysicsModel
from sklearn_pgnn.physics.expressions import symbol

GRAVITY = {"g": 9.81}


def cart_pole(**changes):
    """A cart with an upright pole, by its energies."""
    said = {
        "coordinates": {"x": "v", "q": "w"},
        "kinetic": "M*v**2/2 + m*((v + l*w*cos(q))**2 + (l*w*sin(q))**2)/2",
        "potential": "m*g*l*cos(q)",
        "dissipation": "b*v**2/2",
        "forces": {"x": "F"},
        "states": {"x": "m", "q": "rad", "v": "m/s", "w": "rad/s"},
        "inputs": {"F": "N"},
        "parameters": {"M": 1.3, "m": 0.4, "l": 0.7, "b": 0.2} | GRAVITY,
    }
    return PhysicsModel.from_lagrangian(**(said | changes))


def double_pendulum():
    """Two point masses on two rods; both angles from the vertical."""
    return PhysicsModel.from_lagrangian(
        {"q1": "w1", "q2": "w2"},
        "(m1 + m2)*l1**2*w1**2/2 + m2*l2**2*w2**2/2 + m2*l1*l2*w1*w2*cos(q1 - q2)",
        "-(m1 + m2)*g*l1*cos(q1) - m2*g*l2*cos(q2)",
        states={"q1": "rad", "q2": "rad", "w1": "rad/s", "w2": "rad/s"},
        parameters={"m1": 1.1, "m2": 0.6, "l1": 0.9, "l2": 0.5} | GRAVITY,
    )


def crane():
    """A trolley with a load on a rope that hangs, and friction of both."""
    return PhysicsModel.from_lagrangian(
        {"x": "v", "q": "w"},
        "M*v**2/2 + m*(v**2 + 2*v*l*w*cos(q) + l**2*w**2)/2",
        "-m*g*l*cos(q)",
        "c*v**2/2 + d*w**2/2",
        {"x": "F"},
        states={"x": "m", "q": "rad", "v": "m/s", "w": "rad/s"},
        inputs={"F": "N"},
        parameters={"M": 120.0, "m": 80.0, "l": 3.0, "c": 30.0, "d": 5.0} | GRAVITY,
    )


def arm(links: int):
    """A planar arm in a vertical plane: point masses and inertias at the ends of its links."""
    numbers = range(1, links + 1)
    q, w = sympy.symbols(f"q1:{links + 1}", real=True), sympy.symbols(f"w1:{links + 1}", real=True)
    m, l, J = (sympy.symbols(f"{c}1:{links + 1}", real=True) for c in "mlJ")  # noqa: E741
    angles = [sympy.Add(*q[: i + 1]) for i in range(links)]
    x = [sympy.Add(*(l[k] * sympy.cos(angles[k]) for k in range(i + 1))) for i in range(links)]
    y = [sympy.Add(*(l[k] * sympy.sin(angles[k]) for k in range(i + 1))) for i in range(links)]
    turn = [sympy.Add(*w[: i + 1]) for i in range(links)]

    def along(place):
        return sympy.Add(*(sympy.diff(place, a) * b for a, b in zip(q, w, strict=True)))

    kinetic = sum(
        m[i] * (along(x[i]) ** 2 + along(y[i]) ** 2) / 2 + J[i] * turn[i] ** 2 / 2
        for i in range(links)
    )
    constants = {f"{c}{i}": 0.3 + 0.1 * i + 0.05 * k for k, c in enumerate("mlJ") for i in numbers}
    return PhysicsModel.from_lagrangian(
        {f"q{i}": f"w{i}" for i in numbers},
        kinetic,
        sum(m[i] * symbol("g") * y[i] for i in range(links)),
        "+".join(f"d*w{i}**2/2" for i in numbers),
        {f"q{i}": f"tau{i}" for i in numbers},
        states={f"q{i}": "rad" for i in numbers} | {f"w{i}": "rad/s" for i in numbers},
        inputs={f"tau{i}": "N m" for i in numbers},
        parameters=constants | {"d": 0.1} | GRAVITY,
    )


def three_masses():
    """Three masses in a row with springs and dampers between them, and nothing else."""
    return PhysicsModel.from_lagrangian(
        {"x1": "v1", "x2": "v2", "x3": "v3"},
        "m1*v1**2/2 + m2*v2**2/2 + m3*v3**2/2",
        "k1*(x1 - x2)**2/2 + k2*(x2 - x3)**2/2",
        "d*(v1 - v2)**2/2 + d*(v2 - v3)**2/2",
        {"x1": "F"},
        states={f"{c}{i}": u for c, u in (("x", "m"), ("v", "m/s")) for i in (1, 2, 3)},
        inputs={"F": "N"},
        parameters={"m1": 1.0, "m2": 2.0, "m3": 0.5, "k1": 30.0, "k2": 70.0, "d": 0.4},
    )


def numbers_of(model, expressions, seed):
    """Evaluate expressions of a model at a random state, with the parameters' values."""
    at = random_point(model, seed)
    return np.array([float(e.xreplace(at).evalf(30)) for e in expressions])


def random_point(model, seed):
    """Return numbers for all symbols of a model."""
    rng = np.random.default_rng(seed)
    at = {symbol(n): sympy.Float(rng.normal()) for n in (*model.states, *model.inputs, "t")}
    return at | {symbol(n): sympy.Float(p.value) for n, p in model.parameters.items()}
