"""What a network brings that can only take energy out, on simulated plants and few records.

Every plant's model lacks an effect: two bodies and a motor lose energy that their models do not
know of, a mass has a spring that hardens, which no loss can stand for. The network as it is by
default, one that corrects the model's rates and one that is passive by construction
(``structure="dissipative"``) are trained alike, on the settings of `physical_loss`. Compared are
the free runs on reference records, in standard deviations of the sensors' noise.

Run ``python benchmarks/passive_network.py --seeds 5``; the table in the documentation is written
anew after every seed.
"""

import warnings

import numpy as np
from physical_loss import SETTINGS, error
from plants import PLANTS
from seed_table import cell, command_line, run_seeds, write_table

from sklearn_pgnn import PGNNLRegressor

STRUCTURES = ("auto", "correction", "dissipative")
MEASURED = {"all six records measured": lambda X, y, plant, random: y, **SETTINGS}


def measure(setting, plant, seed):
    """Return the error of every structure, in standard deviations of the noise."""
    warnings.simplefilter("ignore")
    X, y = PLANTS[plant].make(random_state=seed)
    y = MEASURED[setting](X, y, PLANTS[plant], np.random.default_rng([seed, 7]))
    reference = PLANTS[plant].make(reference=True, random_state=seed)
    found = {}
    for structure in STRUCTURES:
        network = PGNNLRegressor(PLANTS[plant].model, structure=structure, random_state=seed)
        found[structure] = error(network.fit(X, y), plant, *reference)
    return found


def write(found, seeds):
    """Write the table into the documentation."""
    heading = [f'"{structure}"' for structure in STRUCTURES]
    lines = [["plant", "measured", *heading, "better than the first, than the second"]]
    for (setting, plant), results in found.items():
        errors = [[result[structure] for result in results] for structure in STRUCTURES]
        better = [sum(np.less(errors[-1], other)) for other in errors[:-1]]
        lines.append([plant, setting, *map(cell, errors), ", ".join(map(str, better))])
    write_table("passive_network", lines, seeds)


if __name__ == "__main__":
    CASES = [(setting, plant) for plant in ("bodies", "motor", "mass") for setting in MEASURED]
    run_seeds(command_line(__doc__, 5).parse_args(), CASES, measure, write)
