"""What the physical loss brings where measurements are few, noisy or short, on simulated plants.

Every plant's model lacks an effect. The same network is trained without the physical loss, with the
balance of that model, which is wrong, and with one that knows the form of what is lost, but not its
size. The weight is the best of `WEIGHTS` in a cross-validation over the measured training records
alone, 0 among them. Compared are the free runs on reference records, in standard deviations of the
sensors' noise.

Run ``python benchmarks/physical_loss.py --seeds 5``; the table in the documentation is written anew
after every seed.
"""

import warnings

import numpy as np
from plants import PLANTS
from seed_table import cell, command_line, run_seeds, write_table

from sklearn_pgnn import PGNNLRegressor
from sklearn_pgnn.network import EnergyBalance

WEIGHTS = (0.0, 0.03, 0.3)
#: measured records; share of a record that counts as its transient; and how much noise is large
MEASURED, TRANSIENT, NOISY = 2, 0.2, 10.0


def few_labels(X, y, plant, random):
    """Measure some of the records only; of the others the inputs are known."""
    return y.where(X["trajectory"] < MEASURED)


def noisy(X, y, plant, random):
    """Measure some of the records, with much noise."""
    more = np.sqrt(NOISY**2 - 1) * plant.noise
    return few_labels(X, y, plant, random) + more * random.standard_normal(y.shape)


def transient_only(X, y, plant, random):
    """Measure the beginning of some of the records."""
    ends = plant.interval * plant.n_samples * TRANSIENT
    return few_labels(X, y, plant, random).where(X["t"] < ends)


SETTINGS = {
    "two of six records measured": few_labels,
    "ten times the noise as well": noisy,
    "the first fifth of two records": transient_only,
}
KNOWN = {
    "bodies": EnergyBalance(dissipated="G2*T2 + G1*T1", parameters={"G1": 1.0}),
    "motor": EnergyBalance(dissipated="R*i**2 + d*w**2 + Fc*abs(w)", parameters={"Fc": 0.005}),
}
BALANCES = {"of the model": lambda plant: EnergyBalance(), "of known form": KNOWN.__getitem__}


def train(plant, balance, weight, X, y, seed):
    """Train a network."""
    loss = BALANCES[balance](plant)
    network = PGNNLRegressor(
        PLANTS[plant].model, lambda_phy=weight, physics_loss=loss, random_state=seed
    )
    return network.fit(X, y)


def error(network, plant, X, y):
    """Return the root mean square error of free runs, in standard deviations of the noise."""
    measured = y.notna().all(axis=1).to_numpy()
    apart = np.asarray(network.predict(X)).reshape(y.shape) - y.to_numpy()
    return float(np.sqrt(np.mean((apart[measured] / PLANTS[plant].noise) ** 2)))


def validate(plant, balance, weight, X, y, seed):
    """Return the mean error on every measured record, the network not having seen it."""
    found = []
    for out in range(MEASURED):
        inside = (X["trajectory"] == out).to_numpy()
        network = train(plant, balance, weight, X[~inside], y[~inside], seed)
        found.append(error(network, plant, X[inside], y[inside]))
    return np.mean(found)


def measure(setting, plant, seed):
    """Return the errors without the physical loss, and with each balance; and the weights."""
    warnings.simplefilter("ignore")
    random = np.random.default_rng([seed, 7])
    X, y = PLANTS[plant].make(random_state=seed)
    y = SETTINGS[setting](X, y, PLANTS[plant], random)
    reference = PLANTS[plant].make(reference=True, random_state=seed)
    without = validate(plant, "of the model", 0.0, X, y, seed)
    plain = error(train(plant, "of the model", 0.0, X, y, seed), plant, *reference)
    found = {"none": (plain, 0.0)}
    for balance in BALANCES:
        tried = {w: validate(plant, balance, w, X, y, seed) for w in WEIGHTS if w > 0}
        best = min(tried, key=tried.get)
        if tried[best] >= without:
            found[balance] = plain, 0.0
        else:
            network = train(plant, balance, best, X, y, seed)
            found[balance] = error(network, plant, *reference), best
    return found


def write(found, seeds):
    """Write the table into the documentation."""
    head = ["plant", "measured", "without"]
    for balance in BALANCES:
        head += [f"balance {balance}", "weights", "better, equal, worse"]
    lines = [head]
    for (setting, plant), results in found.items():
        plain = [result["none"][0] for result in results]
        line = [plant, setting, cell(plain)]
        for balance in BALANCES:
            errors, weights = zip(*(result[balance] for result in results), strict=True)
            signs = np.sign(np.subtract(errors, plain))
            line += [cell(errors), ", ".join(f"{w:g}" for w in weights)]
            line.append(", ".join(str(int((signs == sign).sum())) for sign in (-1, 0, 1)))
        lines.append(line)
    write_table("physical_loss", lines, seeds)


if __name__ == "__main__":
    CASES = [(setting, plant) for plant in KNOWN for setting in SETTINGS]
    run_seeds(command_line(__doc__, 5).parse_args(), CASES, measure, write)
