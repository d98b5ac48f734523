"""Diagnosis, then network: the extended model as the prior of a PGNN-L."""

import time

import numpy as np
from document import COLOURS, new_picture, save, spread, write_table
from main_table import POINTS, thinned
from methods import best_structure
from plants import PLANTS, judge, records, references, simulated

from sklearn_pgnn import ModelDiagnosis

SHOWN = {
    "golf robot, 250 Hz": "golf robot",
    "valve": "valve",
    "valve, limits": "valve, limits",
}


def tasks(seeds):
    """Return a task for every plant."""
    return [{"plant": plant, "seeds": seeds} for plant in SHOWN]


def run(plant, seeds):
    """Diagnose the prior; train a network on it, and one on the extended model."""
    start = time.process_time()
    diagnosis = ModelDiagnosis(PLANTS[plant].prior).fit(*records(plant))
    seconds = time.process_time() - start
    models = {
        "re-tuned model": diagnosis.refitted_model_,
        "extended model": diagnosis.extended_model_,
    }
    found = {
        "verdict": diagnosis.verdict_,
        "causes": [f"{cause.effect} of {cause.target}" for cause in diagnosis.causes_],
        "seconds": seconds,
        **{name: judge(plant, simulated(model)) for name, model in models.items()},
    }
    for name, model in (("prior", PLANTS[plant].prior), *models.items()):
        nets = [best_structure(model, *records(plant), random_state=seed) for seed in range(seeds)]
        found[f"PGNN-L on the {name}"] = {
            **{k: [judge(plant, net.predict)[k] for net in nets] for k in ("ratio", "truth")},
            "structure": [net.structure_ for net in nets],
            "run": thinned(nets[0].predict(references(plant)[0][0])),
        }
    found["run"] = thinned(simulated(diagnosis.extended_model_)(references(plant)[0][0]))
    return found


LINES = (
    "re-tuned model",
    "extended model",
    "PGNN-L on the prior",
    "PGNN-L on the re-tuned model",
    "PGNN-L on the extended model",
)


def write(results):
    """Write the table and its picture."""
    found = {line["plant"]: line for line in results.found}
    plants = [plant for plant in SHOWN if plant in found]
    lines = [["named", *("; ".join(found[p]["causes"]) or "nothing" for p in plants)]]
    lines += [["verdict", *(found[plant]["verdict"] for plant in plants)]]
    lines += [["diagnosis [s]", *(f"{found[plant]['seconds']:.0f}" for plant in plants)]]
    lines += [[name, *(cell(found[plant][name]) for plant in plants)] for name in LINES]
    title = (
        "Free-run error on the reference records as measured / without noise, over the physical "
        "model's."
    )
    seeds = max(line["seeds"] for line in found.values())
    head = ["", *(SHOWN[plant] for plant in plants)]
    write_table("diagnosed", title, head, lines, results.dates, seeds)
    draw(found, plants)


def cell(found):
    """Write both errors."""
    return " / ".join(spread(np.atleast_1d(found[key])) for key in ("ratio", "truth"))


def draw(found, plants):
    """Draw what is left of the reference record by the prior, its extension and the networks."""
    figure, axes = new_picture(len(plants), 1, height=2.2)
    for plant, ax in zip(plants, axes[:, 0], strict=True):
        X, y = references(plant, noise=0.0)[0]
        t, true = X["t"].to_numpy(), y.to_numpy().ravel()
        runs = {
            "physical model": thinned(simulated(PLANTS[plant].prior)(X)),
            "extended model": found[plant]["run"],
            "PGNN-L": found[plant]["PGNN-L on the prior"]["run"],
            "PGNN-L on the extended model": found[plant]["PGNN-L on the extended model"]["run"],
        }
        every = max(1, t.size // POINTS)
        for name, curve in runs.items():
            ax.plot(
                t[::every],
                np.array(curve) - true[::every],
                linewidth=1,
                color=COLOURS.get(name),
                label=name,
            )
        ax.set_ylabel("error [rad]" if "golf" in plant else "error [largest]", fontsize=8)
        ax.set_title(SHOWN[plant], fontsize=9, loc="left")
    lines, names = axes[0, 0].get_legend_handles_labels()
    figure.legend(lines, names, fontsize=7, ncols=4, frameon=False, loc="outside lower center")
    axes[-1, 0].set_xlabel("time [s]")
    save(figure, "diagnosed")
