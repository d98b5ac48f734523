"""Make a sample report of every verdict: ``python docs/make_samples.py [FOLDER]``.

A cart on a spring is simulated with something hidden, or nothing, and diagnosed like any machine.
The documentation's build makes those that are not there yet.
"""

import sys
from pathlib import Path

import numpy as np

from sklearn_pgnn import ModelDiagnosis, datasets, effects
from sklearn_pgnn.inspection import Provenance
from sklearn_pgnn.inspection.report import write_report

FOLDER = Path(__file__).parent / "_extra" / "samples"
FRICTION = effects.CoulombFriction("v", level=1.0)
#: what is hidden, and by how much the model's parameters are off
HIDDEN = {
    "adequate": (None, 0.0),
    "retuned": (None, 0.05),
    "named": (FRICTION, 0.0),
    "ambiguous": (effects.InputBias("force", bias=0.5), 0.0),
    "unexplained": (effects.Formula("v", ("v*x**2",), (-24.0,)), 0.0),
    "faults": (FRICTION, 0.0),
}


def records(name: str):
    """Return the model, X and y of a sample."""
    effect, error = HIDDEN[name]
    made = datasets.make_cart(5, effect=effect, sample_rate=100, parameter_error=error)
    y = made.y.copy()
    if name == "faults":
        rows = np.random.default_rng(0).integers(0, len(y), 20)
        y.iloc[rows, 0] += 0.5
    return made.prior, made.X, y


def make(name: str, folder: Path) -> None:
    """Diagnose a sample and write its report."""
    model, X, y = records(name)
    diagnosis = ModelDiagnosis(model).fit(X, y)
    few = [effects.CoulombFriction, effects.CubicStiffness, effects.InputDeadZone]
    seen = diagnosis.detectability(few, n_repeats=40) if name == "adequate" else None
    folder.mkdir(parents=True, exist_ok=True)
    provenance = Provenance(command="python docs/make_samples.py")
    write_report(diagnosis, folder / f"{name}.html", provenance, seen)


def make_missing(folder: Path = FOLDER) -> None:
    """Make those samples that are not there."""
    for name in HIDDEN:
        if not (folder / f"{name}.html").exists():
            make(name, folder)


def main() -> None:
    """Make all samples anew."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER
    for name in HIDDEN:
        make(name, folder)


if __name__ == "__main__":
    main()
