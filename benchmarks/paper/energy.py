"""Pareto fronts over lambda_phy, and what the energy term adds in each structure."""

from collections import defaultdict

import numpy as np
import pandas as pd
from document import new_picture, save, spread, write_table
from methods import QUICK
from plants import PLANTS, records, references, rmse, simulated

from sklearn_pgnn import PGNNLRegressor
from sklearn_pgnn.model_selection import pareto_front

SHOWN = {
    "golf robot, 250 Hz": "golf robot",
    "golf robot, 250 Hz, transient": "golf robot, transient only",
    "valve": "valve",
    "valve, limits": "valve, limits",
}
#: structures, and how they are drawn
STRUCTURES = {
    "output": ("s", "#8a4fa3"),
    "increment": ("^", "#1766ad"),
    "correction": ("o", "#d1600b"),
}
LAMBDAS = (0.0, 0.01, 0.1, 0.5)


def tasks(seeds):
    """Return a task for every plant, structure and seed."""
    return [
        {"plant": plant, "structure": structure, "seed": seed}
        for seed in range(seeds)
        for plant in SHOWN
        for structure in STRUCTURES
    ]


def run(plant, structure, seed):
    """Weigh the energy of one network by every lambda_phy."""
    truth = references(plant, noise=0.0)
    X_test, y_test = joined(truth)
    net = PGNNLRegressor(PLANTS[plant].prior, structure=structure, random_state=seed, **QUICK)
    front = pareto_front(net, *records(plant), lambdas=LAMBDAS, X_test=X_test, y_test=y_test)
    scale = float(y_test.std(ddof=0).iloc[0]) / rmse(simulated(PLANTS[plant].prior), truth)
    return {
        "ratio": list(scale * front["error"]),
        "physics": list(front["physics"]),
    }


def joined(tables):
    """Join records into one table."""
    numbered = [X.assign(trajectory=i) for i, (X, _) in enumerate(tables)]
    ys = [y for _, y in tables]
    return pd.concat(numbered, ignore_index=True), pd.concat(ys, ignore_index=True)


def write(results):
    """Write the table of the ablation, and the picture of the fronts."""
    found = defaultdict(list)
    for line in results.found:
        found[line["plant"], line["structure"]].append((line["ratio"], line["physics"]))
    head = ["plant", "structure", *(f"{weight:g}" for weight in LAMBDAS)]
    lines = [
        [name, structure, *(spread(each) for each in np.array(runs)[:, 0].T)]
        for plant, name in SHOWN.items()
        for structure in STRUCTURES
        if (runs := found.get((plant, structure)))
    ]
    title = (
        "Free-run error on the reference records without noise, over the physical model's, by "
        "lambda_phy with the balance of the prior's energy."
    )
    write_table("energy", title, head, lines, results.dates, min(map(len, found.values())))
    draw(found)


def draw(found):
    """Draw the medians over the seeds; what no other weight beats in both is filled."""
    plants = [plant for plant in SHOWN if any(plant == known for known, _ in found)]
    figure, axes = new_picture(len(plants), 1, height=3.0)
    for plant, ax in zip(plants, axes[:, 0], strict=True):
        for structure in STRUCTURES:
            if found.get((plant, structure)):
                error, physics = np.median(found[plant, structure], axis=0)
                draw_front(ax, error, physics, structure)
        ax.set(xscale="log", yscale="log", ylabel="error over the model's")
        ax.set_title(SHOWN[plant], fontsize=9, loc="left")
        ax.legend(fontsize=7, frameon=False, loc="upper left", bbox_to_anchor=(1, 1))
    axes[-1, 0].set_xlabel("mean squared residual of the prior's balance")
    save(figure, "pareto_fronts")


def draw_front(ax, error, physics, structure):
    """Draw one structure's points, and the numbers of the weights."""
    best = [
        not any(
            (e <= error[i]) & (p <= physics[i]) & ((e < error[i]) | (p < physics[i]))
            for e, p in zip(error, physics, strict=True)
        )
        for i in range(len(error))
    ]
    marker, colour = STRUCTURES[structure]
    ax.plot(physics, error, marker, mfc="none", color=colour, label=structure)
    order = np.argsort(physics[best])
    style = {"marker": marker, "color": colour, "linewidth": 1}
    ax.plot(physics[best][order], error[best][order], **style)
    for weight, x, y in zip(LAMBDAS, physics, error, strict=True):
        where = {"xytext": (4, 3), "textcoords": "offset points", "fontsize": 6}
        ax.annotate(f"{weight:g}", (x, y), color=colour, **where)
