r"""The machines once more, written by hand and integrated without the package.

A mechanism is :math:`M(q)\,\dot v = f(q, v, u) - J^\top e`, with the efforts :math:`e` of what is
hidden at its ports; a network is :math:`\dot x = f(x, u)`. All records advance at once, by Runge
and Kutta's steps; dry friction is held within a step, and holds what is at rest. Axes: record, then
quantity.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

Array = np.ndarray
Values = dict[str, float]
Rates = Callable[[Array, Array, Values], Array]


@dataclass(frozen=True)
class Rig:
    """What the records come from.

    Parameters
    ----------
    rates, outputs : callable
        Rates of the states, and outputs from states, rates and inputs; ``(x, u, p)`` and
        ``(x, rates, u, p)``.
    slopes : callable, optional
        Of a mechanism, the inverse mass matrix over all states from states and parameters.
    ports : dict of str to (flow, displacement)
        Rows of weights of the states, by port.
    """

    rates: Rates
    outputs: Callable[[Array, Array, Array, Values], Array]
    slopes: Callable[[Array, Values], Array] | None = None
    ports: dict[str, tuple[Array, Array]] = field(default_factory=dict)


def integrate(rates, x0: Array, u: Array, dt: float, substeps: int, during=None) -> Array:
    """Return the states at every sample; u, of (sample, record, input), is held.

    What acts `during` a step is asked for at its beginning.
    """
    x, h = x0.copy(), dt / substeps
    states = [x]
    for now in u[:-1]:
        for _ in range(substeps):
            rate = rates if during is None else during(x, now)
            k1 = rate(x, now)
            k2 = rate(x + h / 2 * k1, now)
            k3 = rate(x + h / 2 * k2, now)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + rate(x + h * k3, now))
        states.append(x)
    return np.array(states)


def mechanism(mass, force, ports, outputs) -> Rig:
    """Return a rig of positions and then velocities."""

    def rates(x, u, p):
        v = x[:, x.shape[1] // 2 :]
        matrix = mass(x, p)
        return np.concatenate([v, np.linalg.solve(matrix, force(x, u, p)[..., None])[..., 0]], 1)

    def slopes(x, p):
        inverse = np.linalg.inv(mass(x, p))
        zero = np.zeros_like(inverse)
        return np.block([[zero, zero], [zero, inverse]])

    n = len(next(iter(ports.values())))
    rows = {
        name: (np.r_[np.zeros(n), weights], np.r_[weights, np.zeros(n)])
        for name, weights in ports.items()
    }
    return Rig(rates, outputs, slopes, rows)


def positions(*numbers: int):
    """Return outputs that are states, by their numbers."""
    return lambda x, rates, u, p: x[:, list(numbers)]


def matrix(*rows) -> Array:
    """Return a matrix a record from entries that are numbers, or one a record."""
    count = max(np.size(entry) for row in rows for entry in row)
    full = [[np.broadcast_to(entry, count) for entry in row] for row in rows]
    return np.moveaxis(np.array(full, dtype=float), -1, 0)


def columns(*entries) -> Array:
    """Return one row a record."""
    count = max(np.size(entry) for entry in entries)
    return np.stack([np.broadcast_to(entry, count) for entry in entries], axis=1)


# -- mechanisms ------------------------------------------------------------------------------------


def crane() -> Rig:
    """Return a trolley and a load on a rope of constant length."""

    def mass(x, p):
        c = p["m"] * p["l"] * np.cos(x[:, 1])
        return matrix([p["M"] + p["m"], c], [c, p["m"] * p["l"] ** 2])

    def force(x, u, p):
        q, v, w = x[:, 1], x[:, 2], x[:, 3]
        pull = p["m"] * p["l"] * w**2 * np.sin(q)
        return columns(
            u[:, 0] - p["d"] * v + pull, -p["m"] * 9.81 * p["l"] * np.sin(q) - p["c"] * w
        )

    return mechanism(mass, force, {"v": [1, 0], "w": [0, 1]}, positions(0, 1))


def cart_pole() -> Rig:
    """Return a cart and a uniform rod that hangs from it; q is zero where it hangs."""

    def mass(x, p):
        c = p["m"] * p["l"] * np.cos(x[:, 1])
        return matrix([p["M"] + p["m"], c], [c, 4 / 3 * p["m"] * p["l"] ** 2])

    def force(x, u, p):
        q, v, w = x[:, 1], x[:, 2], x[:, 3]
        return columns(
            u[:, 0] - p["b"] * v - p["k"] * x[:, 0] + p["m"] * p["l"] * w**2 * np.sin(q),
            -p["m"] * 9.81 * p["l"] * np.sin(q) - p["c"] * w,
        )

    return mechanism(mass, force, {"v": [1, 0], "w": [0, 1]}, positions(0, 1))


def _two_links(x, p):
    h = p["m2"] * p["l1"] * p["l2"]
    a = p["J1"] + p["m1"] * p["l1"] ** 2 + p["m2"] * p["l1"] ** 2
    b = p["J2"] + p["m2"] * p["l2"] ** 2
    return a, b, h * np.cos(x[:, 1]), h * np.sin(x[:, 1])


def two_link_arm() -> Rig:
    """Return a planar arm in a horizontal plane; q2 is the elbow's angle."""

    def mass(x, p):
        a, b, c, _ = _two_links(x, p)
        return matrix([a + b + 2 * c, b + c], [b + c, b])

    def force(x, u, p):
        s, (w1, w2) = _two_links(x, p)[3], x[:, 2:].T
        return columns(
            u[:, 0] - p["d1"] * w1 + s * (2 * w1 * w2 + w2**2),
            u[:, 1] - p["d2"] * w2 - s * w1**2,
        )

    return mechanism(mass, force, {"w1": [1, 0], "w2": [0, 1]}, positions(0, 1))


def scara() -> Rig:
    """Return two links in a horizontal plane, and a hand that turns at their end."""

    def mass(x, p):
        a, b, c, _ = _two_links(x, p)
        j = p["J3"]
        return matrix([a + b + 2 * c + j, b + c + j, j], [b + c + j, b + j, j], [j, j, j])

    def force(x, u, p):
        s, (w1, w2, w3) = _two_links(x, p)[3], x[:, 3:].T
        return columns(
            u[:, 0] - p["d1"] * w1 + s * (2 * w1 * w2 + w2**2),
            u[:, 1] - p["d2"] * w2 - s * w1**2,
            u[:, 2] - p["d3"] * w3,
        )

    ports = {"w1": [1, 0, 0], "w2": [0, 1, 0], "w3": [0, 0, 1]}
    return mechanism(mass, force, ports, positions(0, 1, 2))


def elastic_joint() -> Rig:
    """Return a motor that turns a link in gravity through a spring."""

    def mass(x, p):
        return matrix([np.full(len(x), p["J"]), 0.0], [0.0, p["I"]])

    def force(x, u, p):
        twist, slip = x[:, 0] - x[:, 1], x[:, 2] - x[:, 3]
        torque = p["k"] * twist + p["b"] * slip
        return columns(
            u[:, 0] - p["d"] * x[:, 2] - torque,
            torque - p["G"] * np.sin(x[:, 1]) - p["c"] * x[:, 3],
        )

    return mechanism(mass, force, {"wm": [1, 0], "wl": [0, 1], "joint": [1, -1]}, positions(0, 1))


def gear() -> Rig:
    """Return a motor and a load with teeth between them; `gap` is the play, 0 in the model."""

    def mass(x, p):
        return matrix([np.full(len(x), p["J"]), 0.0], [0.0, p["I"]])

    def force(x, u, p):
        twist, slip = x[:, 0] - x[:, 1], x[:, 2] - x[:, 3]
        half = p.get("gap", 0.0) / 2
        torque = p["k"] * (twist - np.clip(twist, -half, half)) + p["b"] * slip
        return columns(
            u[:, 0] - p["d"] * x[:, 2] - torque, torque - p["c"] * x[:, 3] - p["s"] * x[:, 1]
        )

    return mechanism(mass, force, {"wm": [1, 0], "wl": [0, 1]}, positions(0, 1))


def three_masses() -> Rig:
    """Return a motor, a gear and a load on two shafts, the load on a soft spring."""

    def mass(x, p):
        one = np.ones(len(x))
        return np.einsum("r,ij->rij", one, np.diag([p["J1"], p["J2"], p["J3"]]))

    def force(x, u, p):
        one = p["k1"] * (x[:, 0] - x[:, 1]) + p["b"] * (x[:, 3] - x[:, 4])
        two = p["k2"] * (x[:, 1] - x[:, 2]) + p["b"] * (x[:, 4] - x[:, 5])
        ends = p["d"] * x[:, 3], p["d"] * x[:, 5] + p["s"] * x[:, 2]
        return columns(u[:, 0] - one - ends[0], one - two, two - ends[1])

    ports = {"w1": [1, 0, 0], "w2": [0, 1, 0], "w3": [0, 0, 1], "shaft": [0, 1, -1]}
    return mechanism(mass, force, ports, positions(0, 1, 2))


def quarter_car() -> Rig:
    """Return body, strut, wheel and tyre; the accelerations of body and wheel are measured."""

    def mass(x, p):
        return matrix([np.full(len(x), p["mb"]), 0.0], [0.0, p["mw"]])

    def force(x, u, p):
        strut = p["ks"] * (x[:, 0] - x[:, 1]) + p["ds"] * (x[:, 2] - x[:, 3])
        return columns(-strut, strut - p["kt"] * (x[:, 1] - u[:, 0]))

    def outputs(x, rates, u, p):
        return columns(x[:, 0] - x[:, 1], rates[:, 2], rates[:, 3])

    return mechanism(mass, force, {"strut": [1, -1]}, outputs)


# -- networks --------------------------------------------------------------------------------------


def building_2r1c() -> Rig:
    """Return a room between the weather and the ground."""

    def rates(x, u, p):
        heat, outside, ground = u.T
        flows = heat - (x[:, 0] - outside) / p["R1"] - (x[:, 0] - ground) / p["R2"]
        return columns(flows / p["C"])

    return Rig(rates, positions(0))


def building_3r2c() -> Rig:
    """Return air and wall; windows pass the wall by. Only the air is measured."""

    def rates(x, u, p):
        heat, outside = u.T
        air, wall = x.T
        inner, outer = (wall - air) / p["Ri"], (outside - wall) / p["Ro"]
        window = (outside - air) / p["Rw"]
        return columns((heat + inner + window) / p["Ca"], (outer - inner) / p["Cw"])

    return Rig(rates, positions(0))


def cell(branches: int) -> Rig:
    """Return a cell with a straight open-circuit voltage and one or two branches."""

    def rates(x, u, p):
        current = u[:, 0]
        bent = [
            (p[f"R{i}"] * current - x[:, i]) / (p[f"R{i}"] * p[f"C{i}"])
            for i in range(1, branches + 1)
        ]
        return columns(-current / p["Q"], *bent)

    def outputs(x, rates, u, p):
        return columns(3.2 + 0.9 * x[:, 0] - p["R0"] * u[:, 0] - x[:, 1:].sum(axis=1))

    return Rig(rates, outputs)


def rlc() -> Rig:
    """Return a coil in series with a resistor and a capacitor; `Is` is where the coil saturates."""

    def rates(x, u, p):
        current, charged = x.T
        inductance = p["L"] / (1 + (current / p.get("Is", np.inf)) ** 2)
        return columns((u[:, 0] - p["R"] * current - charged) / inductance, current / p["C"])

    return Rig(rates, positions(0, 1))
