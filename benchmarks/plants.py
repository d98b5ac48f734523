"""Three small plants that a user might have, each with a model that lacks one effect.

A mass whose spring hardens, two bodies that lose heat to the room, and a motor with Stribeck
friction. `make` gives their records as tables: six to train on, or four others to compare with.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from sklearn_pgnn import PhysicsModel

TRAINING, REFERENCE = 6, 4


@dataclass(frozen=True)
class Plant:
    """A plant and the model that is had of it.

    Parameters
    ----------
    model : PhysicsModel
        The model, which lacks an effect.
    truth : PhysicsModel
        The plant.
    interval : float
        Sample interval [s].
    n_samples : int
        Samples of a record.
    inputs : tuple of float
        Least and largest input.
    hold : int
        Samples for which a level of the input is held.
    noise : float
        Standard deviation of the measurement noise [unit of the outputs].
    reference_share : float, default=1
        Share of the inputs' range that the records to compare with take: what resonates must not
        leave the states that were trained on.
    """

    model: PhysicsModel
    truth: PhysicsModel
    interval: float
    n_samples: int
    inputs: tuple[float, float]
    hold: int
    noise: float
    reference_share: float = 1.0

    def make(self, *, reference=False, random_state=0):
        """Make records as tables X and y."""
        random = np.random.default_rng([random_state, reference])
        share, n_records = (self.reference_share, REFERENCE) if reference else (1.0, TRAINING)
        tables = [self._record(i, random, share) for i in range(n_records)]
        return tuple(pd.concat(parts, ignore_index=True) for parts in zip(*tables, strict=True))

    def _record(self, i, random, share):
        t = self.interval * np.arange(self.n_samples)
        levels = share * random.uniform(*self.inputs, self.n_samples // self.hold + 1)
        u = np.repeat(levels, self.hold)[: self.n_samples]
        run = self.truth.simulate(t, u, substeps=16)
        X = pd.DataFrame({"trajectory": i, "t": t, next(iter(self.model.inputs)): u})
        for name, x0 in zip(self.model.states, run.x[0], strict=True):
            X[name] = np.where(t == 0, x0, np.nan)
        noise = self.noise * random.standard_normal(run.y.shape)
        return X, pd.DataFrame(run.y + noise, columns=list(self.model.outputs))


def truth_of(model, missing):
    """Return a machine: its model, with what that lacks subtracted from the rates."""
    rates = {name: str(rate) for name, rate in model.equations.items()}
    rates = {name: rate.replace("Max", "max").replace("Abs", "abs") for name, rate in rates.items()}
    lacking = {name: f"{rate} - ({missing.get(name, 0)})" for name, rate in rates.items()}
    return model.replace(equations=lacking)


def _plant(model, missing, **options):
    """Build the plant from its model and what that lacks."""
    return Plant(model, truth_of(model, missing), **options)


MASS = PhysicsModel(
    states={"x": "m", "v": "m/s"},
    parameters={"m": 1.0, "d": 0.3, "k": 4.0},
    equations={"x": "v", "v": "(force - d*v - k*x)/m"},
    inputs={"force": "N"},
    outputs={"position": "x"},
    inertia={"v": "m"},
    energy={"stored": "m*v**2/2 + k*x**2/2", "dissipated": "d*v**2", "supplied": "force*v"},
)
BODIES = PhysicsModel(
    states={"T1": "K", "T2": "K"},
    parameters={"C1": 400.0, "C2": 900.0, "G": 6.0, "G2": 2.0},
    equations={"T1": "(heat - G*(T1 - T2))/C1", "T2": "(G*(T1 - T2) - G2*T2)/C2"},
    inputs={"heat": "W"},
    outputs={"first": "T1", "second": "T2"},
    energy={"stored": "C1*T1 + C2*T2", "dissipated": "G2*T2", "supplied": "heat"},
)
MOTOR = PhysicsModel(
    states={"i": "A", "w": "rad/s"},
    parameters={"L": 2e-3, "R": 1.0, "K": 0.05, "J": 1e-4, "d": 2e-5},
    equations={"i": "(voltage - R*i - K*w)/L", "w": "(K*i - d*w)/J"},
    inputs={"voltage": "V"},
    outputs={"speed": "w"},
    inertia={"w": "J"},
    energy={
        "stored": "L*i**2/2 + J*w**2/2",
        "dissipated": "R*i**2 + d*w**2",
        "supplied": "voltage*i",
    },
)
STRIBECK = "(0.02 + 0.02*exp(-abs(w)/8))*tanh(w/0.5)/J"

PLANTS = {
    "mass": _plant(
        MASS, {"v": "3*x**3/m"},
        interval=0.05, n_samples=400, inputs=(-6.0, 6.0), hold=20, noise=0.002,
        reference_share=0.7,
    ),
    "bodies": _plant(
        BODIES, {"T1": "3*T1/C1"},
        interval=10.0, n_samples=300, inputs=(0.0, 600.0), hold=30, noise=0.05,
    ),
    "motor": _plant(
        MOTOR, {"w": STRIBECK},
        interval=0.004, n_samples=400, inputs=(-6.0, 6.0), hold=25, noise=0.3,
    ),
}  # fmt: skip
