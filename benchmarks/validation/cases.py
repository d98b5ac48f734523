"""What is hidden, where, and by which seed.

The seeds are drawn from two roots. `FROZEN` makes the cases that the documentation reports: they
are never looked at while something is decided. `DEVELOPMENT` makes others of the same kinds, to
work with.
"""

import itertools
import zlib
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from machines import MACHINES
from scipy.signal import lfilter
from sensors import SENSORS

from sklearn_pgnn import datasets, effects
from sklearn_pgnn.datasets.integrator import integrate
from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.effects.formula import Formula
from sklearn_pgnn.physics.expressions import parse_expression, symbol
from sklearn_pgnn.simulation.pointwise import numpy_function

FROZEN, DEVELOPMENT = 27_678_720, 7
#: seeds of every single effect on every machine; cases of the other kinds
SINGLE, PAIRS, TRIPLES, NOTHING, OUTSIDE = 3, 60, 40, 300, 60
#: ids of the effects that pairs and triples are drawn from, in the order in which they were drawn
#: first: with an effect of the catalogue that came later, the cases would become others
DRAWN_FROM = (
    "coulomb_friction",
    "stribeck_friction",
    "asymmetric_friction",
    "viscous_friction",
    "quadratic_drag",
    "linear_stiffness",
    "quadratic_stiffness",
    "cubic_stiffness",
    "constant_load",
    "cogging",
    "end_stop",
    "hysteresis",
    "periodic_disturbance",
    "rate_limit",
    "state_limit",
    "overflow",
    "leak",
    "input_bias",
    "input_gain",
    "input_dead_zone",
    "input_saturation",
    "input_delay",
    "actuator_lag",
    "input_rate_limit",
    "input_backlash",
    "sensor_bias",
    "sensor_gain",
    "sensor_saturation",
    "sensor_rectification",
    "sensor_delay",
    "wrong_parameter",
    "parameter_drift",
)
#: of these, what was known as a special case of what then: such a pair is not drawn
SPECIAL_CASES = {
    "stribeck_friction": ("coulomb_friction",),
    "asymmetric_friction": ("coulomb_friction", "viscous_friction", "constant_load"),
    "overflow": ("state_limit",),
    "input_rate_limit": ("actuator_lag",),
    "input_backlash": ("actuator_lag",),
}
#: size of a law beyond the catalogue, and of a disturbance, over the rate's spread; how fast the
#: disturbance changes, as a share of a record
LAW, DISTURBANCE, FADES = 0.3, 0.1, 1 / 50
#: times that effects are drawn which a machine may bear, all of them at once
ATTEMPTS = 100


@dataclass(frozen=True)
class Case:
    """A machine, what is hidden in its records, and a seed.

    Parameters
    ----------
    kind : {"single", "pair", "triple", "nothing", "law", "disturbance"}
        What is hidden.
    machine : str
        Where.
    detail : str
        The effect of a single one; the sensor where nothing is hidden; else empty.
    seed : int
        What draws everything random.
    """

    kind: str
    machine: str
    detail: str
    seed: int

    @property
    def name(self) -> str:
        """One line that tells the case."""
        return f"{self.kind}, {self.machine}, {self.detail or '-'}, {self.seed}"


def all_cases(root: int) -> list[Case]:
    """List the cases of a root, single effects first."""
    cases = [
        (("single", machine, kind.id), number)
        for machine, plant in MACHINES.items()
        for kind in effects.CATALOGUE
        if kind.targets(plant.model)
        for number in range(SINGLE)
    ]
    sensors = [name for name in SENSORS if name != "white"]
    nothing = (name for other in itertools.cycle(sensors) for name in ("white", other))
    kinds = [("pair", "")] * PAIRS + [("triple", "")] * TRIPLES
    kinds += [("nothing", sensor) for sensor, _ in zip(nothing, range(NOTHING), strict=False)]
    kinds += [("law", ""), ("disturbance", "")] * (OUTSIDE // 2)
    machines = itertools.cycle(MACHINES)
    cases += [
        ((kind, machine, detail), number)
        for number, ((kind, detail), machine) in enumerate(zip(kinds, machines, strict=False))
    ]
    return [Case(*what, seed_of(root, *what, number)) for what, number in cases]


def seed_of(root, *what) -> int:
    """Draw a seed that depends on the root and on what a case is, not on its place."""
    words = zlib.crc32(repr(what).encode())
    return int(np.random.SeedSequence([root, words]).generate_state(1)[0])


def make(case: Case) -> datasets.HiddenEffect:
    """Make the records of a case, the prior and the truth, with effects that the machine bears."""
    for attempt in range(ATTEMPTS):
        try:
            return _attempt(case, case.seed + attempt)
        except ValueError as error:
            unfit = isinstance(error, ModelError) or "becomes non-finite" in str(error)
            if not unfit or attempt == ATTEMPTS - 1:
                raise


def _attempt(case: Case, seed: int) -> datasets.HiddenEffect:
    machine, rng = MACHINES[case.machine], np.random.default_rng(seed)
    options = {**machine.options, "noise": machine.noise, "random_state": seed % 2**32}
    if case.kind == "nothing":
        clean = datasets.make_hidden_effect(machine.model, None, **{**options, "noise": 0.0})
        return _measured(clean, case.detail, machine.noise, rng)
    if case.kind == "law":
        return _hide_law(machine, options, rng)
    if case.kind == "disturbance":
        return _disturb(machine, options, rng)
    count = {"single": 1, "pair": 2, "triple": 3}[case.kind]
    drawn = case.detail or _draw_effects(machine.model, count, rng)
    return datasets.make_hidden_effect(machine.model, drawn, **options)


def _measured(clean, sensor, noise, rng):
    """Let a sensor look at clean records."""
    n_records = clean.X["trajectory"].nunique()
    y = clean.y.to_numpy().reshape(n_records, -1, clean.y.shape[1])
    seen = SENSORS[sensor](y, noise, rng).reshape(clean.y.shape)
    return replace(clean, y=pd.DataFrame(seen, columns=clean.y.columns))


def _draw_effects(model, count, rng) -> list[str]:
    """Draw kinds of effects, none of them a special case of another."""
    kinds = [kind for kind in map(effects.by_id, DRAWN_FROM) if kind.targets(model)]
    while True:
        drawn = [kinds[place] for place in rng.choice(len(kinds), count, replace=False)]
        ids = [kind.id for kind in drawn]
        if not any(a in SPECIAL_CASES.get(b, ()) for a, b in itertools.permutations(ids, 2)):
            return ids


def course(model, hidden):
    """Return the time, and inputs and initial states of all records."""
    records = [rows for _, rows in hidden.X.groupby("trajectory")]
    t, u = records[0]["t"].to_numpy(), np.stack([r[list(model.inputs)] for r in records])
    return t - t[0], u, np.stack([rows[list(model.states)].iloc[0] for rows in records])


def _spread_of_rate(t, x) -> float:
    return np.std(np.gradient(x, t, axis=1))


def _hide_law(machine, options, rng):
    """Take a term from a rate, its spread a share of the rate's without it."""
    model, (state, term) = machine.model, machine.laws[rng.integers(len(machine.laws))]
    t, u, x0 = course(model, datasets.make_hidden_effect(model, None, **options))
    x, _ = integrate(model, t, u, x0)
    signals = dict(zip(model.inputs, np.moveaxis(u, -1, 0), strict=True))
    signals |= dict(zip(model.states, np.moveaxis(x, -1, 0), strict=True))
    added = parse_expression(term, signals)
    spread = np.std(numpy_function(tuple(signals), added)(*signals.values()))
    size = float(-LAW * _spread_of_rate(t, signals[state]) / spread)
    return datasets.make_hidden_effect(model, Formula(state, (term,), (size,)), **options)


def _disturb(machine, options, rng):
    """Add slow noise to a rate; the model knows nothing of it."""
    model, state = machine.model, machine.laws[0][0]
    hidden = datasets.make_hidden_effect(model, None, **options)
    t, u, x0 = course(model, hidden)
    x, calm = integrate(model, t, u, x0)
    keeps = np.exp(-1.0 / (FADES * t.size))
    slow = lfilter([np.sqrt(1 - keeps**2)], [1, -keeps], rng.standard_normal(u.shape[:2]))
    slow *= DISTURBANCE * _spread_of_rate(t, x[..., list(model.states).index(state)])
    rates = {**model.equations, state: model.equations[state] + symbol("outside")}
    rig = model.replace(equations=rates, inputs={**model.inputs, "outside": ""})
    _, y = integrate(rig, t, np.concatenate([u, slow[..., None]], axis=2), x0)
    return replace(hidden, y=hidden.y + (y - calm).reshape(hidden.y.shape))
