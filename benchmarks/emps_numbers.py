"""Why EMPS's test leaves more than its training: which number of the model is another one there.

The prior with the friction by direction that the diagnosis names is fitted in free run to the
training record. Then one of its numbers after the other is fitted to the test record, the others
staying as the training has taught; this explains the table of ``benchmarks/public.py``, and chooses
nothing in it. The table is written to ``docs/tables/emps_numbers.rst``. Run:
``python benchmarks/emps_numbers.py [--data FOLDER]``.
"""

import argparse
import datetime
import warnings
from dataclasses import replace
from pathlib import Path

from public import MACHINES, errors_by_trajectory, thinned

import sklearn_pgnn
from sklearn_pgnn import PhysicsModelRegressor, effects

TABLE = Path(__file__).parents[1] / "docs" / "tables" / "emps_numbers.rst"


def fit(model, X, y, free=None):
    """Fit parameters to whole trajectories."""
    options = {"window_length": "trajectory", "search": "local"}
    return PhysicsModelRegressor(model, free=free, **options).fit(X, y)


def measure(machine, folder):
    """Return a line for the training's numbers, one for each number alone, and one for all."""
    data = machine.load(data_home=folder)
    test = thinned(replace(data, X_train=data.X_test, y_train=data.y_test), machine.every)

    def line(fitted, names):
        error = errors_by_trajectory(data, fitted.predict(data.X_test))[0]
        said = (f"{name} {fitted.parameters_[name].value:.4g}" for name in names)
        return [", ".join(said) or "none", f"{machine.factor * error:.3g}"]

    friction = effects.AsymmetricFriction("v", level_forward=20.0, level_backward=20.0)
    taught = fit(data.prior + friction, *thinned(data, machine.every))
    values = {name: estimate.value for name, estimate in taught.parameters_.items()}
    model = taught.model.with_parameters(**values)
    yield line(taught, ())
    for name, value in values.items():
        alone, error = line(fit(model, *test, free=[name]), [name])
        yield [f"{alone} (training {value:.4g})", error]
    yield line(fit(model, *test), values)


def main():
    """Measure, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", help="folder of the benchmark's own files; else downloaded")
    warnings.simplefilter("ignore")
    text = (
        f".. list-table:: Written by ``python benchmarks/emps_numbers.py`` on "
        f"{datetime.date.today()} with sklearn_pgnn {sklearn_pgnn.__version__}.\n"
        f"   :header-rows: 1\n   :widths: 70 30\n\n"
    )
    head = ["fitted to the test record", "its free run leaves [mm]"]
    for cells in [head, *measure(MACHINES["EMPS"], parser.parse_args().data)]:
        print(*cells, flush=True)
        text += "   * - " + "\n     - ".join(cells) + "\n"
    TABLE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
