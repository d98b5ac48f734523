"""What it brings to fit a model's parameters and a network together, on three simulated plants.

Every plant's model lacks one effect, and each of its parameters is 20 % off, up or down by the
seed. Compared are the free run on reference records, in standard deviations of their noise (1 is
the best there is), and the largest error of the parameters that the records tell from what the
network may learn: those that do not belong to the rate that lacks something, or that multiply what
the network does not see.

Run ``python benchmarks/network_together.py --seeds 5``; the table in the documentation is written
anew after every seed.
"""

import warnings
from dataclasses import dataclass, replace

import numpy as np
from plants import PLANTS, Plant
from seed_table import cell, command_line, run_seeds, write_table

from sklearn_pgnn import PGNNLRegressor, PhysicsModelRegressor

#: how far off every parameter is, and how far the model says it may be
OFF, SPREAD = 0.2, 0.5


@dataclass(frozen=True)
class Case:
    """A plant, what is known of its missing effect, and the parameters that this leaves telling."""

    plant: Plant
    corrects: list
    sees: list
    telling: tuple


def both_measured(motor):
    """Measure the motor's current too, and know its inductance."""
    outputs = {"current": "i", "speed": "w"}
    known = [replace(p, fixed=p.name == "L") for p in motor.model.parameters.values()]
    return replace(
        motor,
        model=motor.model.replace(outputs=outputs, parameters=known),
        truth=motor.truth.replace(outputs=outputs),
        noise=np.array([0.02, 0.3]),
    )


CASES = {
    "mass, hardening spring": Case(PLANTS["mass"], ["v"], ["x"], ("m", "d")),
    "bodies, loss to the room": Case(PLANTS["bodies"], ["T1"], ["T1"], ("C1", "C2", "G", "G2")),
    "motor, Stribeck friction": Case(both_measured(PLANTS["motor"]), ["w"], ["w"], ("R", "K", "J")),
}


def prior(model, seed):
    """Return the model with all parameters off that are not known."""
    random = np.random.default_rng(seed)
    signs = random.choice([-1, 1], len(model.parameters))
    changed = [
        p if p.fixed else p.with_value(p.value * (1 + OFF * sign)).with_spread(SPREAD)
        for p, sign in zip(model.parameters.values(), signs, strict=True)
    ]
    return model.replace(parameters=changed)


def model_alone(case, model, X, y, seed):
    """Fit the parameters to whole trajectories."""
    return PhysicsModelRegressor(model, window_length="trajectory").fit(X, y)


def network_alone(case, model, X, y, seed):
    """Train the network over the prior."""
    return PGNNLRegressor(model, random_state=seed).fit(X, y)


def one_after_the_other(case, model, X, y, seed):
    """Fit the parameters first, then train the network over the fitted model."""
    return network_alone(case, model_alone(case, model, X, y, seed).model_, X, y, seed)


def added_freely(case, model, X, y, seed):
    """Train both, and let chance decide who takes what."""
    return PGNNLRegressor(model, free="all", overlap=0, random_state=seed).fit(X, y)


def together(case, model, X, y, seed):
    """Train both; the network sees everything."""
    return PGNNLRegressor(model, free="all", random_state=seed).fit(X, y)


def together_with_sight(case, model, X, y, seed):
    """Train both; the network sees what the missing effect depends on."""
    sight = {"corrects": case.corrects, "sees": case.sees}
    return PGNNLRegressor(model, free="all", **sight, random_state=seed).fit(X, y)


WAYS = {
    "model alone, fitted": model_alone,
    "network over the prior": network_alone,
    "fitted first, then the network": one_after_the_other,
    "together, ``overlap=0``": added_freely,
    "together": together,
    "together, ``corrects`` and ``sees``": together_with_sight,
}


def measure(name, way, seed):
    """Fit once; give the free-run error in the noise, and the worst parameter's error [%]."""
    warnings.simplefilter("ignore")
    case = CASES[name]
    plant = case.plant
    X, y = plant.make(random_state=seed)
    model = prior(plant.model, seed)
    fitted = WAYS[way](case, model, X, y, seed)
    X, y = plant.make(reference=True, random_state=seed)
    error = np.asarray(fitted.predict(X)).reshape(y.shape) - y.to_numpy()
    truth = plant.model.parameters
    off = [fitted.model_.parameters[p].value / truth[p].value - 1 for p in case.telling]
    return float(np.sqrt(np.mean((error / plant.noise) ** 2))), 100 * float(np.max(np.abs(off)))


def write(found, seeds):
    """Write the table into the documentation."""
    head = ["way"]
    for name, case in CASES.items():
        head += [name, f"largest error of {', '.join(case.telling)} [%]"]
    lines = [head]
    for way in WAYS:
        errors = [zip(*found[name, way], strict=True) for name in CASES]
        lines.append([way, *(cell(column) for pair in errors for column in pair)])
    write_table("network_together", lines, seeds)


if __name__ == "__main__":
    run_seeds(
        command_line(__doc__, 3).parse_args(),
        [(name, way) for name in CASES for way in WAYS],
        measure,
        write,
    )
