"""The results of a fleet as tables and plain data."""

from dataclasses import asdict

import pandas as pd

from sklearn_pgnn.estimation.plain_data import finite
from sklearn_pgnn.inspection.cause_names import cause_name

CHANGE = ["machine", "kind", "what", "sure"]


def machines_frame(fleet) -> pd.DataFrame:
    """Return the machines, one row each."""
    changes: dict[str, list[str]] = {}
    for change in fleet.changes_:
        changes.setdefault(change.machine, []).append(change.what)
    rows = [
        {
            "machine": name,
            "verdict": machine.verdict,
            "causes": ", ".join(cause_name(*pair) for pair in machine.named),
            "sure": machine.sure,
            "explained_share": machine.explained,
            "odd": ", ".join(p.name for p in fleet.parameters_.values() if name in p.odd),
            "changed": "; ".join(changes.get(name, ())),
            "seconds": machine.seconds,
            "failed": machine.failed,
        }
        for name, machine in fleet.machines_.items()
    ]
    return pd.DataFrame(rows)


def parameters_frame(fleet) -> pd.DataFrame:
    """Return every parameter of every machine."""
    rows = [
        {"machine": machine, "parameter": name, "value": value, "low": low, "high": high,
         "unit": spread.unit, "usual": spread.usual, "odd": machine in spread.odd}
        for name, spread in fleet.parameters_.items()
        for machine, (value, low, high) in spread.values.items()
    ]  # fmt: skip
    columns = ["machine", "parameter", "value", "low", "high", "unit", "usual", "odd"]
    return pd.DataFrame(rows, columns=columns)


def causes_frame(fleet) -> pd.DataFrame:
    """Return every named cause of every machine."""
    rows = [
        {"machine": name, "effect": effect, "target": target, "probability": cause["probability"],
         "gain_percent": cause["gain_percent"], "parameters": cause["parameters"]}
        for name, machine in fleet.machines_.items()
        for (effect, target), cause in machine.named.items()
    ]  # fmt: skip
    columns = ["machine", "effect", "target", "probability", "gain_percent", "parameters"]
    return pd.DataFrame(rows, columns=columns)


def changes_frame(fleet) -> pd.DataFrame:
    """Return every change."""
    return pd.DataFrame([asdict(change) for change in fleet.changes_], columns=CHANGE)


def fleet_dict(fleet) -> dict:
    """Return the results of the fleet as plain data."""
    told = ("unit", "prior", "usual", "spread", "shared")
    parameters = {
        name: {key: getattr(spread, key) for key in told} | {"odd": dict(spread.odd)}
        for name, spread in fleet.parameters_.items()
    }
    return finite(
        {
            "machines": machines_frame(fleet).to_dict("records"),
            "causes": [asdict(cause) for cause in fleet.causes_],
            "parameters": parameters,
            "changes": [asdict(change) for change in fleet.changes_],
            "new": list(fleet.new_),
            "missing": list(fleet.missing_),
        }
    )
