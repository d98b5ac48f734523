"""A balance of energies with a wrong dissipation, and which terms avoid its pull.

The model of the golf robot has half as much dry friction again as the prior. A network of
increments, guided by it, learns with the model's own balance, with passivity, and with the balance
of the model that `ModelDiagnosis` has extended.
"""

from functools import lru_cache

import numpy as np
from document import new_picture, save, spread, write_table
from methods import QUICK
from plants import records, references, rmse, simulated

from sklearn_pgnn import ModelDiagnosis, PGNNLRegressor, effects, network, systems

PLANT = "golf robot, 250 Hz"
#: friction of the wrong model over the prior's
FACTOR = 1.5
#: candidates that add no states: the network has those of the model only
FRICTIONS = (
    effects.WrongParameter,
    effects.ViscousFriction,
    effects.CoulombFriction,
    effects.StribeckFriction,
    effects.AsymmetricFriction,
    effects.QuadraticDrag,
)
LAMBDAS = (0.0, 0.01, 0.1, 0.5)
TERMS = ("the model's balance", "passivity", "the extended model's balance")


class BalanceOf(network.EnergyBalance):
    """The balance of another model's energy.

    Parameters
    ----------
    other : PhysicsModel
        The model, with the states and inputs of the one that guides.
    """

    def __init__(self, other=None, weight=1.0):
        super().__init__(weight=weight)
        self.other = other

    def bind(self, model, motion):
        """Get ready for the other model's energy."""
        return super().bind(self.other, motion)


def tasks(seeds):
    """Return a task for every term and seed."""
    return [{"term": term, "seed": seed} for seed in range(seeds) for term in TERMS]


def wrong_model():
    """Return the prior with too much dry friction."""
    golf = systems.golf_robot()
    return golf.with_parameters(mu=FACTOR * golf.parameters["mu"].value)


@lru_cache(maxsize=1)
def extended_model():
    """Diagnose the model, with friction as the only candidates; give its extension."""
    diagnosis = ModelDiagnosis(wrong_model(), catalogue=FRICTIONS)
    return diagnosis.fit(*records(PLANT)).extended_model_


def make_term(term):
    """Make a physical term by its name."""
    if term == TERMS[1]:
        return network.Passivity()
    return network.EnergyBalance() if term == TERMS[0] else BalanceOf(extended_model())


def run(term, seed):
    """Train with every weight; give the errors, and how near the runs come to the wrong model."""
    model, truth = wrong_model(), references(PLANT, noise=0.0)
    wrong = simulated(model)
    scale = rmse(wrong, truth)
    found = {"ratio": [], "from_model": []}
    for weight in LAMBDAS:
        net = PGNNLRegressor(
            model,
            structure="increment",
            lambda_phy=weight,
            physics_loss=make_term(term),
            random_state=seed,
            **QUICK,
        ).fit(*records(PLANT))
        found["ratio"].append(rmse(net.predict, truth) / scale)
        by_model = [(X, wrong(X)) for X, _ in truth]
        found["from_model"].append(rmse(net.predict, by_model) / scale)
    return found


def write(results):
    """Write the table and its picture."""
    found = {term: [line for line in results.found if line["term"] == term] for term in TERMS}
    found = {term: lines for term, lines in found.items() if lines}
    lines = [
        [term, key, *(spread(each) for each in np.array([line[name] for line in runs]).T)]
        for term, runs in found.items()
        for key, name in (("error", "ratio"), ("distance", "from_model"))
    ]
    head = ["term", "", *(f"{weight:g}" for weight in LAMBDAS)]
    title = (
        f"A model with {FACTOR:g} times the prior's dry friction guides: free-run error on the "
        "reference records without noise, and distance of the free run from the wrong model's, "
        "both over the wrong model's error, by lambda_phy."
    )
    write_table("dissipation", title, head, lines, results.dates, min(map(len, found.values())))
    draw(found)


def draw(found):
    """Draw errors and distances over the weight."""
    figure, axes = new_picture(1, 2, height=3.0)
    places = np.arange(len(LAMBDAS))
    for term, runs in found.items():
        for ax, key in zip(axes[0], ("ratio", "from_model"), strict=True):
            values = np.array([line[key] for line in runs])
            (line,) = ax.plot(places, np.median(values, axis=0), "o-", label=term)
            ax.fill_between(
                places, values.min(axis=0), values.max(axis=0), alpha=0.15, color=line.get_color()
            )
    for ax, label in zip(axes[0], ("error", "distance"), strict=True):
        ax.set_xticks(places, [f"{weight:g}" for weight in LAMBDAS])
        ax.set(xlabel="lambda_phy", ylabel=f"{label} / wrong model's error", yscale="log")
    axes[0, 0].legend(fontsize=7, frameon=False)
    save(figure, "dissipation")
