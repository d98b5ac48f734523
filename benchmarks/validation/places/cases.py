"""The cases: 80 with an effect at a place, 40 with nothing hidden.

The seeds are drawn from two roots. `FROZEN` makes the cases that count: they are run once, when
everything is decided. `DEVELOPMENT` makes others of the same kinds, to work with.
"""

import itertools
import zlib
from dataclasses import dataclass

import hidden as hide
import numpy as np
import pandas as pd
from hidden import Changed, Hidden
from plants import PLANTS, RECORDS, Plant
from rigs import integrate

from sklearn_pgnn import PhysicsModel

FROZEN, DEVELOPMENT = 57_281_128, 11
HIDDEN, NOTHING = 80, 40
#: how far the prior's parameters are off; a diagnosis takes 10 % for calibrated
OFF = 0.05


@dataclass(frozen=True)
class Case:
    """A machine, the number of what is hidden there (-1 for nothing), and a seed."""

    machine: str
    number: int
    seed: int

    @property
    def plant(self) -> Plant:
        """The machine."""
        return PLANTS[self.machine]

    @property
    def hidden(self) -> Hidden | None:
        """What is hidden."""
        return None if self.number < 0 else self.plant.hidden[self.number]


def all_cases(root: int) -> list[Case]:
    """List the cases of a root: what can be hidden in turn, then nothing on every machine."""
    places = [(name, n) for name, plant in PLANTS.items() for n in range(len(plant.hidden))]
    drawn = list(itertools.islice(itertools.cycle(places), HIDDEN))
    drawn += [(name, -1) for name in itertools.islice(itertools.cycle(PLANTS), NOTHING)]
    return [Case(*what, _seed(root, *what, turn)) for turn, what in enumerate(drawn)]


def _seed(root: int, *what) -> int:
    words = zlib.crc32(repr(what).encode())
    return int(np.random.SeedSequence([root, words]).generate_state(1)[0])


@dataclass(frozen=True)
class Records:
    """What a user would have: a prior, and tables of inputs and outputs."""

    prior: PhysicsModel
    X: pd.DataFrame
    y: pd.DataFrame


def make(case: Case) -> Records:
    """Make the records of a case."""
    plant, rng = case.plant, np.random.default_rng(case.seed)
    p = {name: each.value for name, each in plant.model.parameters.items()}
    t = plant.dt * np.arange(plant.samples)
    u = plant.drive(t, RECORDS, rng)
    rig = _rig(case, p, u, rng)
    _, y = _run(plant, rig, u)
    y = y + plant.noise * y.std(axis=(0, 1)) * rng.standard_normal(y.shape)
    return Records(_prior(plant.model, rng), _inputs(plant.model, t, u), _outputs(plant.model, y))


def _rig(case: Case, p, u, rng) -> Changed:
    """Return the rig with what is hidden; its size follows from a run in which nothing is."""
    plant, what = case.plant, case.hidden
    if what is None:
        return hide.plain(plant.rig, p)
    x, _ = _run(plant, hide.plain(plant.rig, p), u)
    if what.target not in plant.rig.ports:
        return plant.change(plant.rig, p, what, x, u, rng)
    rates = np.array([plant.rig.rates(a, b, p) for a, b in zip(x, u, strict=True)])
    return hide.at_port(plant.rig, p, what, (x, rates), plant.dt / plant.substeps, rng)


def _run(plant: Plant, rig: Changed, u):
    """Return states and outputs of shape (samples, records, quantities)."""
    start = [plant.start.get(name, 0.0) for name in plant.model.states]
    start += [start[0] if plant.model.capacity else 0.0] * rig.added
    x0 = np.tile(start, (u.shape[1], 1))
    x = integrate(rig.rates, x0, u, plant.dt, plant.substeps, rig.during)
    if not np.all(np.isfinite(x)):
        raise ValueError(f"{plant.model.name}: expected a finite run")
    return x, np.array([rig.outputs(a, b) for a, b in zip(x, u, strict=True)])


def _prior(model: PhysicsModel, rng) -> PhysicsModel:
    """Return the model with its parameters a bit off."""
    free = model.free_parameters
    off = 1 + OFF * rng.uniform(-1, 1, len(free))
    values = {n: model.parameters[n].value * o for n, o in zip(free, off, strict=True)}
    return model.with_parameters(**values)


def _table(quantities, values) -> pd.DataFrame:
    return pd.DataFrame(np.swapaxes(values, 0, 1).reshape(-1, values.shape[-1]), columns=quantities)


def _inputs(model: PhysicsModel, t, u) -> pd.DataFrame:
    table = _table(list(model.inputs), u)
    table.insert(0, "t", np.tile(t, u.shape[1]))
    table.insert(0, "trajectory", np.repeat(np.arange(u.shape[1]), t.size))
    return table


def _outputs(model: PhysicsModel, y) -> pd.DataFrame:
    return _table(list(model.outputs), y)
