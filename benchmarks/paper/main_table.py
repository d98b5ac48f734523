"""Section III: every method, tuned by the same search on the same records, on every plant."""

import time

import numpy as np
from document import COLOURS, new_picture, save, spread, write_table
from methods import NETWORKS, make_methods, seeded, tune
from plants import PLANTS, judge, references, rmse, simulated, split
from sklearn.base import clone

#: plants, and the name of their tables
TABLES = {
    "golf robot": "golf_robot",
    "valve": "valve",
    "valve, limits": "valve_limits",
    "golf robot, transient": "transient",
}
TITLES = {
    "golf robot": "Golf robot.",
    "valve": "Servo valve, prior without limits.",
    "valve, limits": "Servo valve, prior with limits.",
    "golf robot, transient": "Golf robot, learnt from the first 1.5 s of every record.",
}
METHODS = (
    "plain network",
    "SINDYc, paper's library",
    "SINDYc, prior's terms",
    "residual modelling",
    "PGNN",
    "PGNN-L",
)
#: what does not see the prior is the same under both priors of the valve
NO_PRIOR, SAME = ("plain network", "SINDYc, paper's library"), {"valve, limits": "valve"}
#: neurons in each of two layers, to find the smallest network that is good enough, and how good
SIZES, ENOUGH, SIZE_SEEDS = (2, 3, 5, 9), 1.05, 3
#: points of a drawn curve
POINTS = 1000


def tasks(seeds):
    """Return a task for every plant and method."""
    return [
        {"plant": plant, "method": method, "seeds": seeds}
        for plant in TABLES
        for method in METHODS
        if not (method in NO_PRIOR and plant in SAME)
    ]


def run(plant, method, seeds):
    """Tune at seed 0, fit with every seed, and judge; of networks find the smallest too."""
    estimator, space = make_methods(plant)[method]
    best = tune(seeded(estimator, 0), space, *split(plant)[:2])
    estimator.set_params(**best)
    found = {"best": best, **fit_all(plant, estimator, seeds)}
    if method in NETWORKS and PLANTS[plant].paper:
        found |= find_smallest(plant, estimator)
    return found


def fit_all(plant, estimator, seeds):
    """Fit with every seed; give the errors, the times and the first seed's free runs."""
    X, y, *test = split(plant)
    errors, seconds, runs = [], [], []
    for seed in range(seeds):
        start = time.process_time()
        fitted = seeded(clone(estimator), seed).fit(X, y)
        seconds.append(time.process_time() - start)
        errors.append(judge(plant, fitted.predict, [test]))
        runs.append(thinned(fitted.predict(references(plant)[0][0])))
    return {
        **{key: [each[key] for each in errors] for key in errors[0]},
        "seconds": seconds,
        "run": runs[0],
    }


def find_smallest(plant, estimator):
    """Find the smallest network within 5 % of the best; held-out training records tell."""
    X, y, *_ = split(plant)
    held_out, errors = {}, {}
    for size in SIZES:
        nets = [
            seeded(clone(estimator), seed).set_params(module__neurons=size).fit(X, y)
            for seed in range(SIZE_SEEDS)
        ]
        held_out[size] = float(np.median([net.free_run_error_ for net in nets]))
        errors[size] = [judge(plant, net.predict) for net in nets]
    enough = ENOUGH * min(held_out.values())
    smallest = min(size for size in SIZES if held_out[size] <= enough)
    return {
        "smallest": smallest,
        "smallest_ratio": [each["ratio"] for each in errors[smallest]],
        "smallest_truth": [each["truth"] for each in errors[smallest]],
        "held_out": {str(size): value for size, value in held_out.items()},
    }


def thinned(curve):
    """Keep what a picture shows of a curve."""
    curve = np.ravel(curve)
    return [round(float(v), 5) for v in curve[:: max(1, curve.size // POINTS)]]


# -- what is written -------------------------------------------------------------------------------


def write(results):
    """Write a table and a picture for every plant that has results."""
    found = [*results.found, *borrowed(results.found)]
    for plant in TABLES:
        by_method = {line["method"]: line for line in found if line["plant"] == plant}
        if by_method:
            write_plant(plant, by_method, results.dates)
    draw("free_runs", ("golf robot", "valve", "valve, limits"), found)
    draw("transient", ("golf robot", "golf robot, transient"), found)


def borrowed(found):
    """Take over what does not see the prior, with its errors over those of the other prior."""
    return [
        {**rescaled(line, PLANTS[line["plant"]].prior, PLANTS[plant].prior), "plant": plant}
        for plant, other in SAME.items()
        for line in found
        if line["plant"] == other and line["method"] in NO_PRIOR
    ]


def rescaled(line, prior, other):
    """Divide errors by those of another prior."""
    plant, (*_, X, y) = line["plant"], split(line["plant"])
    sets = {
        "ratio": references(plant),
        "truth": references(plant, noise=0.0),
        "test": [(X, y)],
    }
    scale = {
        key: rmse(simulated(prior), each) / rmse(simulated(other), each)
        for key, each in sets.items()
    }
    errors = {key: key.removeprefix("smallest_") for key in line if key.endswith(tuple(scale))}
    return {
        **line,
        **{key: [scale[of] * value for value in line[key]] for key, of in errors.items()},
    }


def write_plant(plant, found, dates):
    """Write the table of a plant."""
    paper = PLANTS[plant].paper
    head = ["method", "reference", "without noise", "test", "neurons", "fit [s]"]
    head += ["smallest", "its reference", "without noise", "paper"] if paper else []
    prior = simulated(PLANTS[plant].prior)
    error = [rmse(prior, references(plant, **noise)) for noise in ({}, {"noise": 0.0})]
    both = [f"1 ({each:.3g})" for each in error]
    own = cell_of_paper(paper, "physical model")
    lines = [["physical model", *both, "1", *("–" for _ in range(5)), own]]
    lines += [
        [*line_of(method, found[method]), cell_of_paper(paper, method)]
        for method in METHODS
        if method in found
    ]
    lines = [line[: len(head)] for line in lines]
    floor = rmse(lambda X: noise_free(plant, X), references(plant)) / error[0]
    title = f"{TITLES[plant]} The noise alone is {floor:.3f} of the physical model's error."
    seeds = max(line["seeds"] for line in found.values())
    write_table(TABLES[plant], title, head, lines, dates, seeds)


def noise_free(plant, X):
    """Return the true outputs of a reference record."""
    pairs = zip(references(plant), references(plant, noise=0.0), strict=True)
    return next(true for (known, _), (_, true) in pairs if known is X)


def line_of(method, found):
    """Write the line of a method."""
    neurons = str(2 * found["best"]["module__neurons"]) if method in NETWORKS else "–"
    cells = [spread(found[key]) for key in ("ratio", "truth", "test")]
    cells += [neurons, f"{np.median(found['seconds']):.1f}"]
    if "smallest" not in found:
        return [method, *cells, "–", "–", "–"]
    small = [spread(found[key]) for key in ("smallest_ratio", "smallest_truth")]
    return [method, *cells, str(2 * found["smallest"]), *small]


def cell_of_paper(paper, method):
    """Write the paper's error over its physical model's."""
    return f"{paper[method] / paper['physical model']:.3g}" if method in paper else "–"


def draw(name, plants, found):
    """Draw one panel a plant."""
    figure, axes = new_picture(len(plants), 1)
    for plant, ax in zip(plants, axes[:, 0], strict=True):
        X, y = references(plant)[0]
        t, measured = X["t"].to_numpy(), y.to_numpy().ravel()
        ax.plot(t, measured, color=COLOURS["measured"], linewidth=3, label="measured")
        limit = 1.5 * np.abs(measured).max()
        runs = {"physical model": thinned(simulated(PLANTS[plant].prior)(X))}
        runs |= {line["method"]: line["run"] for line in found if line["plant"] == plant}
        for method in ("physical model", "plain network", "SINDYc, paper's library", "PGNN-L"):
            if method in runs:
                curve = np.clip(runs[method], -limit, limit)
                times = t[:: max(1, t.size // POINTS)]
                ax.plot(times, curve, color=COLOURS[method], linewidth=1, label=method)
        unit = "angle [rad]" if "golf" in plant else "position [largest]"
        ax.set(ylabel=unit, ylim=(-limit, limit))
        ax.set_title(TITLES[plant], fontsize=9, loc="left")
    axes[0, 0].legend(fontsize=7, ncols=5, loc="lower center", frameon=False)
    axes[-1, 0].set_xlabel("time [s]")
    save(figure, name)
