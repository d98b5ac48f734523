"""What the recipe's depth is worth in an experiment that it has not been trained on.

Every plant is trained on one record, driven by two sines (the carriage by a position loop), and
judged in free run on one that is driven by pulses. The model of each lacks an effect. Compared are
the recipe as it is, with a network of the states among its depths and folds that hide ranges of
operation besides blocks of time, and the same without both.

Run ``python benchmarks/another_experiment.py --seeds 4``; the table in the documentation is written
anew after every seed.
"""

import warnings
from functools import partial

import numpy as np
import pandas as pd
from plants import BODIES, MASS, MOTOR, STRIBECK, truth_of
from seed_table import cell, command_line, run_seeds, write_table

from sklearn_pgnn import GreyBoxRegressor, PhysicsModel

CARRIAGE = PhysicsModel(
    states={"q": "m", "v": "m/s"},
    parameters={"M": 95.0, "Fv": 203.0, "Fc": 20.0},
    equations={"q": "v", "v": "(force - Fv*v - Fc*tanh(v/0.002))/M"},
    inputs={"force": "N"},
    outputs={"position": "q"},
    inertia={"v": "M"},
)
PENDULUM = PhysicsModel(
    states={"a": "rad", "w": "rad/s"},
    parameters={"J": 0.1, "d": 0.05, "g": 2.0},
    equations={"a": "w", "w": "(torque - d*w - g*sin(a))/J"},
    inputs={"torque": "N m"},
    outputs={"angle": "a"},
    inertia={"w": "J"},
)
TANKS = PhysicsModel(
    states={"h1": "m", "h2": "m"},
    parameters={"a": 0.02, "b": 0.02, "c": 0.02},
    equations={
        "h1": "a*pump - b*sqrt(max(h1, 0))",
        "h2": "b*sqrt(max(h1, 0)) - c*sqrt(max(h2, 0))",
    },
    inputs={"pump": "V"},
    outputs={"level": "h2"},
    initial_state={"h1": 0.5, "h2": 0.5},
)
#: model, what it lacks, interval [s], samples, range of the input, period [s] and noise
OPEN = {
    "mass": (MASS, {"v": "3*x**3/m"}, 0.05, 800, (-3, 3), 6.0, 0.002),
    "bodies": (BODIES, {"T1": "3*T1/C1"}, 20.0, 600, (0, 600), 2500.0, 0.05),
    "motor": (MOTOR, {"w": STRIBECK}, 0.004, 1000, (-5, 5), 1.0, 0.3),
    "pendulum": (
        PENDULUM, {"w": "0.1*tanh(w/0.05)/J + 0.05*w*abs(w)/J"},
        0.02, 1000, (-1.2, 1.2), 4.0, 0.002,
    ),
    "tanks": (
        TANKS, {"h1": "0.01*max(h1 - 0.6, 0)", "h2": "0.004*h2"},
        2.0, 800, (0.3, 1.0), 400.0, 0.002,
    ),
}  # fmt: skip
STICKING = "(4*tanh(v/0.002) + 6*exp(-abs(v)/0.02)*tanh(v/0.002) + 30*v*abs(v))/M"
COGGING = (
    "(6*sin(2*3.14159*q/0.05) + 3*sin(2*3.14159*q/0.02)"
    " - 4*v*tanh(v/0.002)/(0.1 + abs(v)))/M"
)  # fmt: skip
CLOSED = {"carriage, friction": STICKING, "carriage, cogging": COGGING}
#: of the carriage: interval [s], samples, gains of its loop, and noise [m]
STEP, SAMPLES, STIFF, DAMP, NOISE = 0.005, 2000, 30000.0, 1500.0, 2e-6


def sines(t, rng, low, high, period):
    """Return two sines that fill a range."""
    u = np.zeros(t.size)
    for _ in range(2):
        size, own = rng.uniform(0.5, 1), period * rng.uniform(0.6, 1.6)
        u += size * np.sin(2 * np.pi * t / own + rng.uniform(0, 2 * np.pi))
    return low + (high - low) * (0.5 + 0.5 * u / np.max(np.abs(u)))


def pulses(t, rng, low, high, period):
    """Return pulses to either end of a range, from its middle."""
    u, k, samples = np.full(t.size, 0.5 * (low + high)), 0, period / t[1]
    while k < t.size:
        k += int(samples * rng.uniform(0.2, 0.5))
        length = max(3, int(samples * rng.uniform(0.05, 0.25)))
        u[k : k + length] = rng.choice([low, high])
        k += length
    return u


def there_and_back(t, rng):
    """Return a reference that goes smoothly there and back, with rests."""
    size, period = rng.uniform(0.08, 0.12), rng.uniform(3, 4)
    place = (t % period) / period

    def rise(z):
        z = np.clip(z, 0, 1)
        return z**3 * (10 - 15 * z + 6 * z**2)

    return size * (rise(place / 0.3) - rise((place - 0.5) / 0.3))


def in_a_loop(plant, t, wanted, disturbance):
    """Return the force by which a position loop drives the carriage, its disturbance with it."""
    x, force, rate = np.array([wanted[0], 0.0]), [], np.gradient(wanted, t)
    for k in range(t.size):
        u = STIFF * (wanted[k] - x[0]) + DAMP * (rate[k] - x[1]) + 203 * rate[k] + disturbance[k]
        force.append(u)
        x = plant.simulate([0.0, STEP], [[u], [u]], x, substeps=16).x[-1]
    return np.array(force)


def record(model, plant, t, u, noise, rng):
    """Return a record as tables X and y."""
    run = plant.simulate(t, u[:, None], substeps=16)
    X = pd.DataFrame({"trajectory": 0, "t": t, next(iter(model.inputs)): u})
    for name, x0 in zip(model.states, run.x[0], strict=True):
        X[name] = np.where(t == 0, x0, np.nan)
    return X, run.y + noise * rng.standard_normal(run.y.shape)


def make(name, seed):
    """Return a model, a record to train on and, without noise, one of another experiment."""
    rng = np.random.default_rng([seed, [*OPEN, *CLOSED].index(name), 77])
    if name in OPEN:
        model, missing, step, samples, (low, high), period, noise = OPEN[name]
        plant, t = truth_of(model, missing), step * np.arange(samples)
        inputs = [way(t, rng, low, high, period) for way in (sines, pulses)]
    else:
        model, noise, t = CARRIAGE, NOISE, STEP * np.arange(SAMPLES)
        plant, wanted = truth_of(model, {"v": CLOSED[name]}), there_and_back(t, rng)
        kicks = [np.zeros(t.size), pulses(t, rng, -35.0, 35.0, 1.0)]
        inputs = [in_a_loop(plant, t, wanted, kick) for kick in kicks]
    levels = (noise, 0.0)
    pairs = [record(model, plant, t, u, n, rng) for u, n in zip(inputs, levels, strict=True)]
    return model, *pairs


WAYS = {
    "blocks of time, one network": {"depths": ("fitted", "network"), "by": "time"},
    "as it is": {"depths": ("fitted", "state_network", "network")},
}


def measure(name, way, seed):
    """Return the error on the other experiment, as a share of the fitted model's."""
    warnings.simplefilter("ignore")
    model, (X, y), (X_new, y_new) = make(name, seed)
    fitted = GreyBoxRegressor(model, depths=("fitted",), by="time").fit(X, y)
    recipe = GreyBoxRegressor(model, **WAYS[way]).fit(X, y)
    errors = [np.sqrt(np.mean((each.predict(X_new) - y_new) ** 2)) for each in (recipe, fitted)]
    print(name, way, seed, recipe.depth_, recipe.errors_, flush=True)
    return float(errors[0] / errors[1])


def write(found, seeds):
    """Write the table into the documentation."""
    lines = [["plant", *WAYS]]
    for name in dict.fromkeys(name for name, _ in found):
        lines.append([name, *(cell(found[name, way]) for way in WAYS)])
    everything = [np.concatenate([found[n, way] for n, w in found if w == way]) for way in WAYS]
    lines.append(["all", *map(cell, everything)])
    write_table("another_experiment", lines, seeds)


def main():
    """Measure all plants and ways, seed by seed."""
    asked = command_line(__doc__, 4).parse_args()
    cases = [(name, way) for name in (*OPEN, *CLOSED) for way in WAYS]
    run_seeds(asked, cases, partial(measure), write)


if __name__ == "__main__":
    main()
