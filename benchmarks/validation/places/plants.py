"""The machines: the model as its user has it, the rig, its drive, what is hidden."""

from collections.abc import Callable
from dataclasses import dataclass, field

import hidden as hide
import numpy as np
import rigs
from hidden import Changed, Hidden

from sklearn_pgnn import PhysicsModel

#: effects that are hidden at joints
AT_JOINTS = ("coulomb_friction", "stribeck_friction", "asymmetric_friction", "quadratic_drag")
#: records of a case
RECORDS = 4


@dataclass(frozen=True)
class Plant:
    """A machine.

    Parameters
    ----------
    model : PhysicsModel
        The model at the true parameters.
    rig : Rig
        What the records come from.
    dt, samples : float, int
        Sample time [s], and samples of a record.
    drive : callable
        Inputs of shape (samples, records, inputs) from times, the number of records, a generator.
    hidden : tuple of Hidden
        What may be hidden.
    change : callable, optional
        The rig with a hidden effect that is at no port: from rig, parameters, what, a calm run of
        shape (samples, records, states), inputs and a generator.
    noise : float
        Standard deviation of the sensors' noise over that of the outputs.
    substeps : int
        Integration steps a sample.
    """

    model: PhysicsModel
    rig: rigs.Rig
    dt: float
    samples: int
    drive: Callable
    hidden: tuple[Hidden, ...]
    change: Callable[..., Changed] | None = None
    noise: float = 2e-3
    substeps: int = 20
    start: dict[str, float] = field(default_factory=dict)


def known(**values):
    """Return parameters by name from pairs of value and unit."""
    return {name: {"value": value, "unit": unit} for name, (value, unit) in values.items()}


def at_ports(*pairs: tuple[str, str]) -> tuple[Hidden, ...]:
    """Return effects at ports."""
    return tuple(Hidden(effect, port) for effect, port in pairs)


# -- how they are driven ---------------------------------------------------------------------------


def multisine(amplitudes, low: float, high: float):
    """Return sums of sines of random phases between two frequencies [Hz]."""

    def drive(t, records, rng):
        u = np.zeros((t.size, records, len(amplitudes)))
        for f in np.geomspace(low, high, 12):
            phase = rng.uniform(0, 2 * np.pi, u.shape[1:])
            u += np.sin(2 * np.pi * f * t[:, None, None] + phase)
        return u / u.std(axis=(0, 1)) * np.array(amplitudes)

    return drive


def steps(levels, least: float, most: float):
    """Return steps between levels, held for random times [s]."""

    def drive(t, records, rng):
        u = np.empty((t.size, records, len(levels)))
        for record in range(records):
            for i, (low, high) in enumerate(levels):
                ends = np.cumsum(rng.uniform(least, most, 2 + int(t[-1] / least)))
                u[:, record, i] = rng.uniform(low, high, ends.size)[np.searchsorted(ends, t)]
        return u

    return drive


def weather(heat, outside, period: float):
    """Return steps of heat, and temperatures that swing through the day; the ground is constant."""

    def drive(t, records, rng):
        u = [steps([heat], period / 24, period / 6)(t, records, rng)[..., 0]]
        for mean, swing in outside:
            phase = rng.uniform(0, 2 * np.pi, records)
            u.append(mean + swing * np.sin(2 * np.pi * t[:, None] / period + phase))
        return np.stack(u, axis=-1)

    return drive


def road(height: float, length: float):
    """Return the height of a rough road: noise through a lag of a time [s]."""

    def drive(t, records, rng):
        keep, u = np.exp(-(t[1] - t[0]) / length), np.zeros((t.size, records, 1))
        for i in range(1, t.size):
            u[i] = keep * u[i - 1] + height * np.sqrt(1 - keep**2) * rng.standard_normal(
                (records, 1)
            )
        return u

    return drive


# -- mechanisms ------------------------------------------------------------------------------------

_PENDULUM = {"x": "v", "q": "w"}
_TURNS = {"q1": "rad", "q2": "rad", "w1": "rad/s", "w2": "rad/s"}


def crane() -> Plant:
    """Return trolley and load, by the mass matrix."""
    model = PhysicsModel(
        name="crane",
        states={"x": "m", "q": "rad", "v": "m/s", "w": "rad/s"},
        inputs={"F": "N"},
        outputs={"x": "x", "q": "q"},
        parameters=known(M=(120.0, "kg"), m=(80.0, "kg"), l=(3.0, "m"), d=(30.0, "N s/m"),
                         c=(8.0, "N m s/rad"))
        | {"g": {"value": 9.81, "unit": "m/s^2", "fixed": True}},
        equations=_PENDULUM,
        inertia={"v": ["M + m", "m*l*cos(q)"], "w": ["m*l*cos(q)", "m*l**2"]},
        forces={"v": "F - d*v + m*l*w**2*sin(q)", "w": "-m*g*l*sin(q) - c*w"},
    )  # fmt: skip
    places = [(effect, "v") for effect in AT_JOINTS]
    places += [("coulomb_friction", "w"), ("quadratic_drag", "w")]
    return Plant(model, rigs.crane(), 0.02, 1000, multisine([250.0], 0.1, 1.5), at_ports(*places))


def cart_pole() -> Plant:
    """Return cart with a rod that hangs, by its energies."""
    model = PhysicsModel.from_lagrangian(
        _PENDULUM,
        "M*v**2/2 + m*(v**2 + 2*v*l*w*cos(q) + l**2*w**2)/2 + m*l**2*w**2/6",
        "k*x**2/2 - m*g*l*cos(q)",
        "b*v**2/2 + c*w**2/2",
        {"x": "F"},
        name="cart-pole",
        states={"x": "m", "q": "rad", "v": "m/s", "w": "rad/s"},
        inputs={"F": "N"},
        outputs={"x": "x", "q": "q"},
        parameters=known(M=(1.2, "kg"), m=(0.5, "kg"), l=(0.35, "m"), b=(0.8, "N s/m"),
                         k=(6.0, "N/m"), c=(0.01, "N m s/rad"))
        | {"g": {"value": 9.81, "unit": "m/s^2", "fixed": True}},
    )  # fmt: skip
    places = [("coulomb_friction", "v"), ("stribeck_friction", "v"), ("asymmetric_friction", "v")]
    places += [("coulomb_friction", "w"), ("quadratic_drag", "w"), ("cubic_stiffness", "v")]
    return Plant(model, rigs.cart_pole(), 0.01, 1200, multisine([2.5], 0.2, 4.0), at_ports(*places))


_ARM = known(
    m1=(1.0, "kg"),
    m2=(0.8, "kg"),
    l1=(0.5, "m"),
    l2=(0.4, "m"),
    J1=(0.05, "kg m^2"),
    J2=(0.03, "kg m^2"),
    d1=(0.6, "N m s/rad"),
    d2=(0.3, "N m s/rad"),
)
_LET = {
    "a": "J1 + (m1 + m2)*l1**2",
    "b": "J2 + m2*l2**2",
    "h": "m2*l1*l2*cos(q2)",
    "s": "m2*l1*l2*sin(q2)",
}


def two_link_arm() -> Plant:
    """Return two links and two torques, by the mass matrix with shared subexpressions."""
    model = PhysicsModel(
        name="two-link arm",
        states=_TURNS,
        inputs={"tau1": "N m", "tau2": "N m"},
        outputs={"q1": "q1", "q2": "q2"},
        parameters=_ARM,
        let=_LET,
        equations={"q1": "w1", "q2": "w2"},
        inertia={"w1": ["a + b + 2*h", "b + h"], "w2": ["b + h", "b"]},
        forces={"w1": "tau1 - d1*w1 + s*(2*w1*w2 + w2**2)", "w2": "tau2 - d2*w2 - s*w1**2"},
        ports={"shoulder": {"flow": "w1"}, "elbow": {"flow": "w2"}},
    )
    places = [(effect, port) for port in ("w1", "w2") for effect in AT_JOINTS[:3]]
    return Plant(
        model, rigs.two_link_arm(), 0.01, 1500, multisine([1.5, 0.6], 0.2, 3.0),
        tuple(Hidden(e, p, ((e, {"w1": "shoulder", "w2": "elbow"}[p]),)) for e, p in places),
    )  # fmt: skip


def scara() -> Plant:
    """Return two links and a hand, by the mass matrix."""
    model = PhysicsModel(
        name="SCARA",
        states={f"{c}{i}": u for c, u in (("q", "rad"), ("w", "rad/s")) for i in (1, 2, 3)},
        inputs={"tau1": "N m", "tau2": "N m", "tau3": "N m"},
        outputs={"q1": "q1", "q2": "q2", "q3": "q3"},
        parameters=_ARM | known(J3=(0.01, "kg m^2"), d3=(0.05, "N m s/rad")),
        let=_LET,
        equations={"q1": "w1", "q2": "w2", "q3": "w3"},
        inertia={
            "w1": ["a + b + 2*h + J3", "b + h + J3", "J3"],
            "w2": ["b + h + J3", "b + J3", "J3"],
            "w3": ["J3", "J3", "J3"],
        },
        forces={
            "w1": "tau1 - d1*w1 + s*(2*w1*w2 + w2**2)",
            "w2": "tau2 - d2*w2 - s*w1**2",
            "w3": "tau3 - d3*w3",
        },
    )
    places = [("coulomb_friction", port) for port in ("w1", "w2", "w3")]
    places += [("stribeck_friction", "w2"), ("asymmetric_friction", "w3"), ("quadratic_drag", "w1")]
    return Plant(
        model, rigs.scara(), 0.01, 1200, multisine([1.5, 0.6, 0.1], 0.2, 3.0), at_ports(*places)
    )


def elastic_joint() -> Plant:
    """Return motor and link at a spring, whose ends have a port."""
    model = PhysicsModel(
        name="elastic joint",
        states={"qm": "rad", "ql": "rad", "wm": "rad/s", "wl": "rad/s"},
        inputs={"tau": "N m"},
        outputs={"qm": "qm", "ql": "ql"},
        parameters=known(J=(0.02, "kg m^2"), I=(0.08, "kg m^2"), k=(30.0, "N m/rad"),
                         b=(0.05, "N m s/rad"), d=(0.1, "N m s/rad"), c=(0.03, "N m s/rad"),
                         G=(1.2, "N m")),
        let={"torque": "k*(qm - ql) + b*(wm - wl)"},
        equations={"qm": "wm", "ql": "wl"},
        inertia={"wm": "J", "wl": "I"},
        forces={"wm": "tau - d*wm - torque", "wl": "torque - G*sin(ql) - c*wl"},
        ports={"joint": {"flow": "wm - wl"}},
    )  # fmt: skip
    places = [("coulomb_friction", "wm"), ("coulomb_friction", "wl"), ("stribeck_friction", "wm")]
    places += [
        ("asymmetric_friction", "wl"),
        ("quadratic_drag", "wl"),
        ("cubic_stiffness", "joint"),
    ]
    return Plant(
        model, rigs.elastic_joint(), 0.005, 1500, multisine([0.6], 0.5, 6.0), at_ports(*places)
    )


def gear() -> Plant:
    """Return motor and load at the stiffness of the teeth; the play is hidden."""
    model = PhysicsModel(
        name="gear",
        states={"qm": "rad", "ql": "rad", "wm": "rad/s", "wl": "rad/s"},
        inputs={"tau": "N m"},
        outputs={"qm": "qm", "ql": "ql"},
        parameters=known(J=(0.02, "kg m^2"), I=(0.04, "kg m^2"), k=(60.0, "N m/rad"),
                         b=(0.1, "N m s/rad"), d=(0.1, "N m s/rad"), c=(0.05, "N m s/rad"),
                         s=(1.0, "N m/rad")),
        equations={"qm": "wm", "ql": "wl"},
        inertia={"wm": "J", "wl": "I"},
        forces={"wm": "tau - d*wm - k*(qm - ql) - b*(wm - wl)",
                "wl": "k*(qm - ql) + b*(wm - wl) - c*wl - s*ql"},
    )  # fmt: skip

    def change(rig, p, what, x, u, rng):
        gap = np.std(x[..., 0] - x[..., 1]) * rng.uniform(1.0, 2.5)
        return hide.by_parameter(rig, p, "gap", lambda x, u: gap)

    played = Hidden("spring_play", "k", (("joint_play", "wm"), ("joint_play", "wl")))
    hidden = (played, *at_ports(("coulomb_friction", "wm"), ("coulomb_friction", "wl")), played)
    return Plant(
        model, rigs.gear(), 0.005, 1500, multisine([0.8], 0.3, 5.0), hidden, change, substeps=40
    )


def three_masses() -> Plant:
    """Return three inertias on two shafts, the second of which has a port."""
    turns = {f"{c}{i}": u for c, u in (("q", "rad"), ("w", "rad/s")) for i in (1, 2, 3)}
    model = PhysicsModel(
        name="three masses",
        states=turns,
        inputs={"tau": "N m"},
        outputs={"q1": "q1", "q2": "q2", "q3": "q3"},
        parameters=known(J1=(0.02, "kg m^2"), J2=(0.03, "kg m^2"), J3=(0.05, "kg m^2"),
                         k1=(25.0, "N m/rad"), k2=(18.0, "N m/rad"), b=(0.04, "N m s/rad"),
                         d=(0.05, "N m s/rad"), s=(1.0, "N m/rad")),
        let={"one": "k1*(q1 - q2) + b*(w1 - w2)", "two": "k2*(q2 - q3) + b*(w2 - w3)"},
        equations={"q1": "w1", "q2": "w2", "q3": "w3"},
        inertia={"w1": "J1", "w2": "J2", "w3": "J3"},
        forces={"w1": "tau - one - d*w1", "w2": "one - two", "w3": "two - d*w3 - s*q3"},
        ports={"shaft": {"flow": "w2 - w3"}},
    )  # fmt: skip
    places = [("coulomb_friction", port) for port in ("w1", "w2", "w3")]
    places += [("stribeck_friction", "w2"), ("quadratic_drag", "w3"), ("cubic_stiffness", "shaft")]
    return Plant(
        model, rigs.three_masses(), 0.005, 1500, multisine([1.0], 0.3, 6.0), at_ports(*places)
    )


def quarter_car() -> Plant:
    """Return body, strut, wheel and tyre; two accelerometers and the strut's deflection."""
    model = PhysicsModel(
        name="quarter car",
        states={"zb": "m", "zw": "m", "vb": "m/s", "vw": "m/s"},
        inputs={"r": "m"},
        outputs={"stroke": "zb - zw", "ab": "der(vb)", "aw": "der(vw)"},
        parameters=known(mb=(300.0, "kg"), mw=(40.0, "kg"), ks=(18000.0, "N/m"),
                         ds=(1100.0, "N s/m"), kt=(180000.0, "N/m")),
        let={"spring": "ks*(zb - zw) + ds*(vb - vw)"},
        equations={"zb": "vb", "zw": "vw"},
        inertia={"vb": "mb", "vw": "mw"},
        forces={"vb": "-spring", "vw": "spring - kt*(zw - r)"},
        ports={"strut": {"flow": "vb - vw"}},
    )  # fmt: skip
    kinds = ("coulomb_friction", "asymmetric_friction", "quadratic_drag", "cubic_stiffness")
    return Plant(
        model, rigs.quarter_car(), 0.005, 1500, road(0.015, 0.4),
        at_ports(*((kind, "strut") for kind in kinds)), noise=5e-3,
    )  # fmt: skip


# -- networks --------------------------------------------------------------------------------------

_HOUR = 3600.0
#: what a room exchanges beside what the model knows, over its capacity [1/s], and the share of it
EXCHANGE, SHARES = 4e-5, (0.3, 0.8)


def _change_room(rig, p, what, x, u, rng):
    size = EXCHANGE * rng.uniform(*SHARES)
    if what.effect == "second_store":
        # it takes a share of what the outside takes, and follows within hours
        return hide.second_store(rig, p, 0, size, rng.uniform(3, 8) * _HOUR)
    typical = np.mean(np.abs(x[..., 0] - u[..., 1]))
    power = rng.uniform(0.25, 0.5)
    return hide.power_loss(rig, p, 0, 1, size / typical**power, power)


def building_2r1c() -> Plant:
    """Return one store between weather and ground, by its capacity."""
    model = PhysicsModel(
        name="2R1C building",
        states={"T": "degC"},
        inputs={"P": "W", "Ta": "degC", "Tg": "degC"},
        outputs={"T": "T"},
        parameters=known(C=(8e6, "J/K"), R1=(0.006, "K/W"), R2=(0.02, "K/W")),
        capacity={"T": "C"},
        flows={"T": "P - (T - Ta)/R1 - (T - Tg)/R2"},
        initial_state={"T": 20.0},
    )
    hidden = (Hidden("second_store", "T"), Hidden("power_loss", "T(Ta)"))
    drive = weather((0.0, 6000.0), ((5.0, 6.0), (9.0, 0.5)), 24 * _HOUR)
    return Plant(model, rigs.building_2r1c(), 300.0, 1200, drive, hidden, _change_room,
                 start={"T": 20.0})  # fmt: skip


def building_3r2c() -> Plant:
    """Return air and wall, by their capacities."""
    model = PhysicsModel(
        name="3R2C building",
        states={"air": "degC", "wall": "degC"},
        inputs={"P": "W", "Ta": "degC"},
        outputs={"T": "air"},
        parameters=known(Ca=(2e6, "J/K"), Cw=(2e7, "J/K"), Ri=(0.002, "K/W"), Ro=(0.006, "K/W"),
                         Rw=(0.01, "K/W")),
        capacity={"air": "Ca", "wall": "Cw"},
        flows={"air": "P + (wall - air)/Ri + (Ta - air)/Rw",
               "wall": "(Ta - wall)/Ro - (wall - air)/Ri"},
        initial_state={"air": 20.0, "wall": 15.0},
    )  # fmt: skip
    hidden = (Hidden("power_loss", "air(Ta)"), Hidden("second_store", "air"))
    drive = weather((0.0, 6000.0), ((5.0, 6.0),), 24 * _HOUR)
    return Plant(model, rigs.building_3r2c(), 300.0, 1500, drive, hidden, _change_room,
                 start={"air": 20.0, "wall": 15.0})  # fmt: skip


def _change_cell(rig, p, what, x, u, rng):
    if what.effect == "relaxation_branch":
        return hide.relaxation_branch(
            rig, p, p["R0"] * rng.uniform(0.5, 1.5), rng.uniform(150, 400)
        )
    more = rng.uniform(0.3, 0.8)
    return hide.by_parameter(rig, p, "R0", lambda x, u: p["R0"] * (1 + more * (u[:, 0] > 0)))


def _cell(branches: int) -> Plant:
    bends = range(1, branches + 1)
    values = ((0.015, 1200.0), (0.008, 20000.0))[:branches]
    constants = {f"R{i}": (r, "Ohm") for i, (r, _) in enumerate(values, 1)}
    constants |= {f"C{i}": (c, "F") for i, (_, c) in enumerate(values, 1)}
    model = PhysicsModel(
        name=f"cell with {branches} branch" + "es" * (branches - 1),
        states={"soc": ""} | {f"v{i}": "V" for i in bends},
        inputs={"I": "A"},
        outputs={"V": "3.2 + 0.9*soc - R0*I" + "".join(f" - v{i}" for i in bends)},
        parameters=known(Q=(9000.0, "A s"), R0=(0.02, "Ohm"), **constants),
        equations={"soc": "-I/Q"} | {f"v{i}": f"(R{i}*I - v{i})/(R{i}*C{i})" for i in bends},
        initial_state={"soc": 0.6},
    )
    by_direction = Hidden("coefficient_by_direction", "R0")
    hidden = (
        (by_direction,) if branches == 2 else (Hidden("relaxation_branch", "V(I)"), by_direction)
    )
    return Plant(
        model, rigs.cell(branches), 2.0, 1500, steps([(-2.5, 2.5)], 20.0, 240.0), hidden,
        _change_cell, noise=3e-3, start={"soc": 0.6},
    )  # fmt: skip


def rlc() -> Plant:
    """Return a coil that saturates, in a resonant circuit."""
    model = PhysicsModel(
        name="RLC",
        states={"i": "A", "uc": "V"},
        inputs={"U": "V"},
        outputs={"i": "i", "uc": "uc"},
        parameters=known(L=(0.01, "H"), R=(2.0, "Ohm"), C=(1e-4, "F")),
        capacity={"i": "L", "uc": "C"},
        flows={"i": "U - R*i - uc", "uc": "i"},
    )

    def change(rig, p, what, x, u, rng):
        bend = float(np.abs(x[..., 0]).max()) * rng.uniform(0.8, 1.6)
        return hide.by_parameter(rig, p, "Is", lambda x, u: bend)

    coil = Hidden("parameter_saturation", "L(i)", (("parameter_slope", "L(i)"),))
    return Plant(
        model, rigs.rlc(), 1e-4, 1500, multisine([8.0], 20.0, 400.0), (coil,), change, substeps=10
    )


PLANTS = {
    plant.model.name: plant
    for plant in (
        crane(), cart_pole(), two_link_arm(), scara(), elastic_joint(), gear(), three_masses(),
        quarter_car(), building_2r1c(), building_3r2c(), _cell(1), _cell(2), rlc(),
    )
}  # fmt: skip
