"""The findings of a diagnosis as tables."""

import math
from typing import TYPE_CHECKING

import pandas as pd

if TYPE_CHECKING:
    from sklearn_pgnn.diagnosis.model_diagnosis import ModelDiagnosis
    from sklearn_pgnn.diagnosis.result import NamedCause


def causes_frame(diagnosis: "ModelDiagnosis") -> pd.DataFrame:
    """Return the named causes as a table, one row per parameter, intervals of 95 %."""
    rows = []
    for place, cause in enumerate(diagnosis.causes_, start=1):
        about = {"cause": place, "effect": cause.effect, "target": cause.target}
        worth = {
            "gain_percent": cause.gain,
            "probability": cause.probability,
            "outside_catalogue": cause.outside,
            "tested": cause.tested,
            "confused_with": ", ".join(f"{r.effect} of {r.target}" for r in cause.confused_with),
        }
        rows += [{**about, **size, **worth} for size in _sizes(cause)]
    return pd.DataFrame(rows, columns=[*_ABOUT, *_SIZE, *_WORTH])


_ABOUT = ("cause", "effect", "target")
_SIZE = ("parameter", "value", "low", "high", "unit")
_WORTH = ("gain_percent", "probability", "outside_catalogue", "tested", "confused_with")


def _sizes(cause: "NamedCause") -> list[dict]:
    """Return a cause's parameters; one empty row where it has none."""
    found = [
        dict(zip(_SIZE, (name, e.value, e.low, e.high, e.unit), strict=True))
        for name, e in cause.parameters.items()
    ]
    return found or [dict(zip(_SIZE, ("", math.nan, math.nan, math.nan, ""), strict=True))]


def parameters_frame(diagnosis: "ModelDiagnosis") -> pd.DataFrame:
    """Return the re-tuned parameters of the prior as a table, one row each."""
    rows = {
        name: {
            "prior": p.prior,
            "value": p.value,
            "low": p.low,
            "high": p.high,
            "unit": p.unit,
            "change_percent": 100 * (p.value / p.prior - 1) if p.prior else math.nan,
            "changed": p.changed,
        }
        for name, p in diagnosis.parameters_.items()
    }
    columns = ["prior", "value", "low", "high", "unit", "change_percent", "changed"]
    return pd.DataFrame.from_dict(rows, orient="index", columns=columns).rename_axis("name")


def gain_frame(diagnosis: "ModelDiagnosis") -> pd.DataFrame:
    """Return the error reduction by re-tuning and extending as a table, one row per output."""
    rows = {}
    for output, gain in diagnosis.gain_.items():
        run = diagnosis.free_run_[output]
        rows[output] = {
            "prior": gain.prior,
            "refitted": gain.refitted,
            "extended": gain.extended,
            "formula": gain.formula,
            "noise": gain.noise,
            "explained_share": gain.explained_share,
            "low": gain.low,
            "high": gain.high,
            "free_run_prior": run.prior,
            "free_run_refitted": run.refitted,
            "free_run_extended": run.extended,
            "free_run_formula": run.formula,
            "unit": gain.unit,
        }
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("output")
