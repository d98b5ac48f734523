"""Several physical terms in one loss, and a weight that adapts itself."""

from collections import defaultdict

import numpy as np
from document import spread, write_table
from methods import QUICK
from plants import PLANTS, judge, records

from sklearn_pgnn import PGNNLRegressor, network

#: plant and structure, and what stands above their column
COLUMNS = {
    ("golf robot, 250 Hz", "increment"): "golf robot, increment",
    ("golf robot, 250 Hz", "correction"): "golf robot, correction",
    ("valve", "increment"): "valve, increment",
    ("valve, limits", "increment"): "valve with limits, increment",
}
#: weight of all terms where it does not adapt
LAMBDA = 0.1
#: what one knows without a model: the club hangs, the slider has ends and is slow
VAGUE = {
    "golf robot, 250 Hz": [network.Bounds({"phi": (-np.pi / 2, np.pi / 2)})],
    "valve": [network.Bounds({"y": (-1.0, 1.0)}), network.RateBounds({"y": (-260.0, 260.0)})],
}
LINES = {
    "no term": (0.0, ""),
    "energy balance": (LAMBDA, "e"),
    "passivity": (LAMBDA, "p"),
    "bounds": (LAMBDA, "b"),
    "passivity and bounds": (LAMBDA, "pb"),
    "all three": (LAMBDA, "epb"),
    "energy balance, adaptive": ("adaptive", "e"),
    "passivity and bounds, adaptive": ("adaptive", "pb"),
}


def tasks(seeds):
    """Return a task for every column, line and seed."""
    return [
        {"plant": plant, "structure": structure, "terms": terms, "seed": seed}
        for seed in range(seeds)
        for plant, structure in COLUMNS
        for terms in LINES
    ]


def make_terms(plant, letters):
    """Return the terms that some letters stand for; None for none."""
    vague = VAGUE[plant.removesuffix(", limits")]
    by_letter = {"e": [network.EnergyBalance()], "p": [network.Passivity()], "b": vague}
    return [term for letter in letters for term in by_letter[letter]] or None


def run(plant, structure, terms, seed):
    """Train one network with some terms."""
    weight, letters = LINES[terms]
    net = PGNNLRegressor(
        PLANTS[plant].prior,
        structure=structure,
        lambda_phy=weight,
        physics_loss=make_terms(plant, letters),
        random_state=seed,
        **QUICK,
    ).fit(*records(plant))
    return {**judge(plant, net.predict), "lambda": float(net.lambda_phy_)}


def write(results):
    """Write the table."""
    found = defaultdict(list)
    for line in results.found:
        found[line["plant"], line["structure"], line["terms"]].append(line["truth"])
    columns = [column for column in COLUMNS if any(column == key[:2] for key in found)]
    lines = [
        [terms, *(spread(found[*column, terms]) for column in columns)]
        for terms in LINES
        if all((*column, terms) in found for column in columns)
    ]
    title = (
        "Free-run error on the reference records without noise, over the physical model's, by the "
        f"terms of the physical loss; lambda_phy is {LAMBDA:g} or adaptive."
    )
    head = ["terms", *(COLUMNS[column] for column in columns)]
    write_table("loss_terms", title, head, lines, results.dates, min(map(len, found.values())))
