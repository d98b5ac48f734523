"""The machines of the validation: seven plants of different kinds, and how they are driven."""

from dataclasses import dataclass, field

from sklearn_pgnn import PhysicsModel, systems


@dataclass(frozen=True)
class Machine:
    """A plant, the noise of its sensors and how its records are made.

    Parameters
    ----------
    model : PhysicsModel
        The plant without any effect.
    noise : float
        Standard deviation of the sensors' noise [output].
    options : dict
        Of `datasets.make_hidden_effect`.
    laws : tuple of (str, str)
        Terms that no effect of the catalogue had when they were chosen, and the states whose rates
        they are taken from. (Since then, ``parameter_slope`` has ``phi*omega`` and ``i*w``.)
    """

    model: PhysicsModel
    noise: float
    options: dict = field(default_factory=dict)
    laws: tuple[tuple[str, str], ...] = ()


def dc_motor() -> PhysicsModel:
    """Return a DC motor whose speed and current are measured."""
    return PhysicsModel(
        name="DC motor",
        states={"w": "rad/s", "i": "A"},
        inputs={"U": "V"},
        outputs={"speed": "w", "current": "i"},
        parameters={
            "J": {"value": 0.02, "unit": "kg m^2", "bounds": [1e-4, 1]},
            "d": {"value": 0.01, "unit": "N m s/rad", "bounds": [0, 1]},
            "K": {"value": 0.5, "unit": "N m/A", "bounds": [0.01, 10]},
            "R": {"value": 2.0, "unit": "Ohm", "bounds": [0.01, 100]},
            "L": {"value": 0.1, "unit": "H", "bounds": [1e-4, 10]},
        },
        equations={"w": "(K*i - d*w)/J", "i": "(U - R*i - K*w)/L"},
        inertia={"w": "J"},
    )


def car() -> PhysicsModel:
    """Return a car of which the speed is measured."""
    return PhysicsModel(
        name="car",
        states={"v": "m/s"},
        inputs={"F": "kN"},
        parameters={
            "m": {"value": 1.2, "unit": "t", "bounds": [0.1, 10]},
            "d": {"value": 0.3, "unit": "kN s/m", "bounds": [0, 10]},
        },
        equations={"v": "(F - d*v)/m"},
        inertia={"v": "m"},
    )


def heated_plate() -> PhysicsModel:
    """Return a heater and a plate of which the plate's temperature is measured."""
    return PhysicsModel(
        name="heated plate",
        states={"T_h": "K", "T_p": "K"},
        inputs={"P": "W"},
        outputs={"T": "T_p"},
        parameters={
            "C_h": {"value": 30.0, "unit": "J/K", "bounds": [1, 1e3]},
            "C_p": {"value": 80.0, "unit": "J/K", "bounds": [1, 1e3]},
            "k": {"value": 2.0, "unit": "W/K", "bounds": [0.01, 100]},
            "a": {"value": 0.8, "unit": "W/K", "bounds": [0.01, 100]},
        },
        equations={"T_h": "(P - k*(T_h - T_p))/C_h", "T_p": "(k*(T_h - T_p) - a*T_p)/C_p"},
    )


def elastic_shaft() -> PhysicsModel:
    """Return two inertias on an elastic shaft; the driven one's angle and speed are measured."""
    return PhysicsModel(
        name="elastic shaft",
        states={"phi": "rad", "w": "rad/s", "twist": "rad", "w_l": "rad/s"},
        inputs={"M": "N m"},
        outputs={"angle": "phi", "speed": "w"},
        parameters={
            "J": {"value": 0.01, "unit": "kg m^2", "bounds": [1e-4, 1]},
            "J_l": {"value": 0.02, "unit": "kg m^2", "bounds": [1e-4, 1]},
            "c": {"value": 4.0, "unit": "N m/rad", "bounds": [0.1, 100]},
            "b": {"value": 0.02, "unit": "N m s/rad", "bounds": [0, 1]},
            "d": {"value": 0.05, "unit": "N m s/rad", "bounds": [0, 1]},
        },
        equations={
            "phi": "w",
            "w": "(M - c*twist - b*(w - w_l) - d*w)/J",
            "twist": "w - w_l",
            "w_l": "(c*twist + b*(w - w_l))/J_l",
        },
        inertia={"w": "J", "w_l": "J_l"},
    )


_TANKS = {
    "n_records": 4,
    "duration": 600.0,
    "sample_rate": 1.0,
    "excitation": ("multisine", "chirp"),
    "amplitude": 2.7,
}
_MOTOR = {"n_records": 6, "sample_rate": 200.0, "duration": 6.0, "amplitude": 10.0}

MACHINES = {
    "golf robot": Machine(
        systems.golf_robot(),
        1e-3,
        {"n_records": 6, "sample_rate": 125.0},
        (("omega", "torque*phi"), ("omega", "omega**2*phi")),
    ),
    "cart": Machine(
        systems.cart_on_spring(),
        1e-3,
        {"n_records": 6, "sample_rate": 200.0},
        (("v", "x**2*v"), ("v", "force*x"), ("v", "v**2")),
    ),
    "two tanks": Machine(
        systems.two_tanks(),
        1e-2,
        _TANKS,
        (("x2", "x1*x2"), ("x2", "x2**2")),
    ),
    "DC motor": Machine(dc_motor(), 1e-2, _MOTOR, (("i", "i**3"), ("i", "w**2"))),
    "car": Machine(
        car(),
        1e-2,
        {"n_records": 6, "sample_rate": 10.0, "duration": 60.0, "amplitude": 3.0},
        (("v", "v**2"),),
    ),
    "heated plate": Machine(
        heated_plate(),
        2e-2,
        {"n_records": 4, "sample_rate": 1.0, "duration": 900.0, "amplitude": 20.0},
        (("T_h", "T_h*T_p"), ("T_h", "T_h*P")),
    ),
    "elastic shaft": Machine(
        elastic_shaft(),
        1e-3,
        {"n_records": 6, "sample_rate": 250.0, "duration": 6.0, "amplitude": 0.5},
        (("w", "twist**2*w"), ("w_l", "twist**2*w_l")),
    ),
}
