"""Draw every effect of the catalogue as one sees it in records: ``python docs/make_thumbnails.py``.

Each is hidden in a simulated machine, found again, and drawn as its own characteristic: the points
of the records, and its law. The page of the catalogue is written beside the pictures.
"""

import warnings
from dataclasses import replace
from pathlib import Path

import matplotlib
from PIL import Image

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, datasets, effects, systems

DOCS = Path(__file__).parent
FOLDER = DOCS / "_static" / "effects"
MOTOR = PhysicsModel(
    name="DC motor",
    states={"w": "rad/s", "i": "A"},
    inputs={"U": "V"},
    outputs={"speed": "w", "current": "i"},
    parameters={
        "J": {"value": 0.02, "unit": "kg m^2", "bounds": [1e-4, 1]},
        "d": {"value": 0.01, "unit": "N m s/rad", "bounds": [0, 1]},
        "K": {"value": 0.5, "unit": "N m/A", "bounds": [0.01, 10]},
        "R": {"value": 2.0, "unit": "Ohm", "bounds": [0.01, 100]},
        "L": {"value": 0.1, "unit": "H", "bounds": [1e-4, 10]},
    },
    equations={"w": "(K*i - d*w)/J", "i": "(U - R*i - K*w)/L"},
    inertia={"w": "J"},
)
OVEN = PhysicsModel(
    name="oven",
    states={"T": "K"},
    inputs={"P": "W", "T_room": "K"},
    outputs={"temperature": "T"},
    parameters={"C": {"value": 80.0, "unit": "J/K", "bounds": [1, 1e4]}},
    equations={"T": "P/C"},
)
SHAFT = PhysicsModel(
    name="shaft",
    states={"a": "rad", "b": "rad", "v": "rad/s", "w": "rad/s"},
    inputs={"torque": "N m"},
    outputs={"motor": "a", "load": "b"},
    parameters={
        "J": {"value": 0.01, "unit": "kg m^2", "bounds": [1e-4, 1]},
        "k": {"value": 3.0, "unit": "N m/rad", "bounds": [0.1, 100]},
        "d": {"value": 0.02, "unit": "N m s/rad", "bounds": [0, 1]},
    },
    equations={
        "a": "v",
        "b": "w",
        "v": "(torque - d*v - k*(a - b))/J",
        "w": "(k*(a - b) - d*w)/J",
    },
    inertia={"v": "J", "w": "J"},
)
KILN = PhysicsModel(
    name="kiln",
    states={"T": "degC"},
    inputs={"P": "W", "T_room": "degC"},
    outputs={"temperature": "T"},
    parameters={
        "C": {"value": 80.0, "unit": "J/K", "bounds": [1, 1e4]},
        "h": {"value": 2.0, "unit": "W/K", "bounds": [0.01, 100]},
    },
    equations={"T": "(P + h*(T_room - T))/C"},
)
CELL = PhysicsModel(
    name="cell",
    states={"z": ""},
    inputs={"I": "A"},
    outputs={"V": "c*z + R0*I"},
    parameters={
        "Q": {"value": 500.0, "unit": "A s", "bounds": [10, 1e5]},
        "k": {"value": 5.0, "unit": "A", "bounds": [0.01, 100]},
        "c": {"value": 1.0, "unit": "V", "bounds": [0.1, 10]},
        "R0": {"value": 0.2, "unit": "Ohm", "bounds": [0.001, 10]},
    },
    equations={"z": "(I - k*z)/Q"},
)
SLOW = {"n_records": 4, "duration": 600.0, "sample_rate": 1.0, "noise": 1e-2}
#: the machines in which an effect is looked for, and how their records are made
MACHINES = (
    (systems.cart_on_spring(), {"n_records": 4, "sample_rate": 100.0, "noise": 1e-3}),
    (MOTOR, {"n_records": 4, "sample_rate": 200.0, "duration": 6.0, "amplitude": 10.0}),
    (
        systems.two_tanks(),
        {"n_records": 4, "duration": 600.0, "sample_rate": 1.0, "amplitude": 2.7, "noise": 1e-2},
    ),
    (OVEN, SLOW),
    (SHAFT, {"n_records": 4, "sample_rate": 100.0, "noise": 1e-3}),
    (KILN, SLOW),
    (CELL, SLOW),
)
#: kinds of targets in the order of the page, and their headings
KINDS = {
    "state": "On a state",
    "input": "On an input",
    "output": "On an output",
    "parameter": "On a parameter",
}
INTRODUCTION = """\
The catalogue in pictures
=========================

Every effect as records show it: points are moments of simulated records, the line is the law as it
was identified; where there are two, orange is the model without the effect, blue with it. ``python
docs/make_thumbnails.py`` draws them; :mod:`sklearn_pgnn.effects` has the equations.
"""


def held(machine: PhysicsModel) -> PhysicsModel:
    """Return a machine of which all is known, so that no parameter does what an effect does."""
    known = {name: replace(p, fixed=True) for name, p in machine.parameters.items()}
    return machine.replace(parameters=known)


def found(effect):
    """Return the diagnosis of a machine that hides an effect, and the machine; None if unseen."""
    tried = [(held(machine), options) for machine, options in MACHINES]
    for machine, options in (*tried, *MACHINES):
        if not effect.targets(machine):
            continue
        try:
            hidden = datasets.make_hidden_effect(
                machine, effect.id, parameter_error=0, random_state=0, **options
            )
        except ValueError:  # nothing of the machine shows it
            continue
        diagnosis = ModelDiagnosis(hidden.prior, catalogue=[effect]).fit(hidden.X, hidden.y)
        if diagnosis.causes_:
            return diagnosis, machine
    return None


def draw(effect) -> str:
    """Draw an effect, and return the machine and the place where it was seen; empty if nowhere."""
    import matplotlib.pyplot as plt

    from sklearn_pgnn.inspection import CharacteristicDisplay

    seen = found(effect)
    if seen is None:
        return ""
    diagnosis, machine = seen
    figure, axes = plt.subplots(figsize=(4.2, 2.6), layout="constrained")
    CharacteristicDisplay.from_estimator(diagnosis, ax=axes)
    axes.set_title("")
    if axes.get_legend() is not None:
        axes.get_legend().remove()
    path = FOLDER / f"{effect.id}.png"
    figure.savefig(path, dpi=80)
    plt.close(figure)
    Image.open(path).quantize(48).save(path, optimize=True)
    return f"{diagnosis.causes_[0].target} of the {machine.name}"


def kind_of(effect) -> str:
    """Return what an effect acts on."""
    for machine, _ in MACHINES:
        for target in effect.targets(machine):
            places = {"state": machine.states, "input": machine.inputs, "output": machine.outputs}
            name = target.split("(")[0]  # as in T(T_room)
            return next((kind for kind, names in places.items() if name in names), "parameter")
    return "state"


def page(drawn: dict[str, str]) -> str:
    """Return the page of the catalogue."""
    lines = [INTRODUCTION.rstrip()]
    for kind, heading in KINDS.items():
        lines += ["", heading, "-" * len(heading), "", ".. list-table::", "   :widths: 45 55", ""]
        for effect in effects.CATALOGUE:
            if kind_of(effect) == kind:
                lines += _row(effect, drawn.get(effect.id, ""))
    return "\n".join(lines) + "\n"


def _row(effect, where: str) -> list[str]:
    name = f"``{effect.id}``"
    text = f"{name}: {effect.summary}" + (f" Here: {where}." if where else "")
    picture = [
        f"     - .. image:: _static/effects/{effect.id}.png",
        f"          :alt: characteristic of {effect.id.replace('_', ' ')}",
    ]
    return [f"   * - {text}", *(picture if where else ["     -"])]


def main() -> None:
    """Draw all, and write the page."""
    matplotlib.use("Agg")
    warnings.simplefilter("ignore")
    FOLDER.mkdir(parents=True, exist_ok=True)
    drawn = {}
    for effect in effects.CATALOGUE:
        drawn[effect.id] = draw(effect)
        print(effect.id, "-", drawn[effect.id] or "not seen", flush=True)
    (DOCS / "catalogue.rst").write_text(page(drawn), encoding="utf-8")


if __name__ == "__main__":
    main()
