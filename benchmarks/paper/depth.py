"""The depth of the prior: what it is worth, and whether a better prior needs fewer neurons."""

from collections import defaultdict

import numpy as np
from document import new_picture, save, spread, write_table
from methods import QUICK, best_structure
from plants import judge, records, simulated
from priors import DEPTHS, make_prior

#: neurons in each of two layers; how much worse than the best is good enough
SIZES, ENOUGH = (2, 4, 8), 1.05


def tasks(seeds):
    """Return a task for every prior, size and seed."""
    return [
        {"plant": plant, "depth": depth, "neurons": neurons, "seed": seed}
        for seed in range(seeds)
        for plant, (_, depths) in DEPTHS.items()
        for depth in depths
        for neurons in SIZES
    ]


def run(plant, depth, neurons, seed):
    """Train a network of a size on a prior."""
    chosen = {**QUICK, "module__neurons": neurons, "random_state": seed}
    best = best_structure(make_prior(plant, depth), *records(plant), **chosen)
    return {
        **judge(plant, best.predict),
        "structure": best.structure_,
        "validation": best.free_run_error_,
    }


def write(results):
    """Write the table and its picture."""
    found = defaultdict(list)
    for line in results.found:
        found[line["plant"], line["depth"], line["neurons"]].append(line)
    lines = [
        line_of(plant, depth, found)
        for plant, (_, depths) in DEPTHS.items()
        for depth in depths
        if all((plant, depth, size) in found for size in SIZES)
    ]
    head = ["plant", "prior", "alone", *(f"{2 * size} neurons" for size in SIZES)]
    head += ["structure", "smallest"]
    title = (
        "Free-run error on the reference records without noise, over that of the deepest prior of "
        "the golf robot and the shallowest of the valve, by depth and neurons; smallest is the "
        "network within 5 % of the best on held-out training records."
    )
    write_table("depth", title, head, lines, results.dates, min(map(len, found.values())))
    draw(found)


def line_of(plant, depth, found):
    """Write the line of one prior."""
    runs = [found[plant, depth, size] for size in SIZES]
    held_out = [np.median([line["validation"] for line in each]) for each in runs]
    smallest = next(s for s, v in zip(SIZES, held_out, strict=True) if v <= ENOUGH * min(held_out))
    chosen = [line["structure"] for each in runs for line in each]
    structure = max(set(chosen), key=chosen.count)
    return [
        plant.removesuffix(", 250 Hz"),
        depth,
        f"{alone(plant, depth):.3g}",
        *(spread([line["truth"] for line in each]) for each in runs),
        f"{structure} ({chosen.count(structure)} of {len(chosen)})",
        str(2 * smallest),
    ]


def alone(plant, depth):
    """Measure a prior alone."""
    return judge(plant, simulated(make_prior(plant, depth)))["truth"]


def draw(found):
    """Draw the error over the neurons, a line a prior."""
    plants = [plant for plant in DEPTHS if any(plant == known for known, *_ in found)]
    figure, axes = new_picture(1, len(plants), width=4.5 * len(plants), height=3.0)
    for plant, ax in zip(plants, axes[0], strict=True):
        for depth in DEPTHS[plant][1]:
            draw_line(ax, plant, depth, found)
        ax.set(xlabel="neurons", ylabel="error over the paper's prior", yscale="log")
        ax.set_title(plant.removesuffix(", 250 Hz"), fontsize=9, loc="left")
        ax.legend(fontsize=7, frameon=False)
    save(figure, "depth")


def draw_line(ax, plant, depth, found):
    """Draw median and range of one prior."""
    sizes = [size for size in SIZES if (plant, depth, size) in found]
    values = [[line["truth"] for line in found[plant, depth, size]] for size in sizes]
    neurons = [2 * size for size in sizes]
    (line,) = ax.plot(neurons, [np.median(each) for each in values], "o-", label=depth)
    low, high = [min(each) for each in values], [max(each) for each in values]
    ax.fill_between(neurons, low, high, alpha=0.15, color=line.get_color())
