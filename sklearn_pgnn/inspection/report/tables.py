"""The errors of a report in rows: in the output's unit, and in units of the noise."""

from sklearn_pgnn.inspection.numbers import free_run_error, number, times, typeset_unit
from sklearn_pgnn.inspection.yardstick import ratio, shown_models


def error_rows(diagnosis) -> list[dict]:
    """Return the errors over held-out windows and in free run, output by output."""
    rows, shown = [], shown_models(diagnosis)
    for output, gain in diagnosis.gain_.items():
        for how, errors in (("held-out windows", gain), ("free run", diagnosis.free_run_[output])):
            rows.append(
                {
                    "output": output,
                    "how": how,
                    "errors": [_error(getattr(errors, which), gain.noise) for which in shown],
                    "noise": number(gain.noise, 3),
                    "unit": typeset_unit(diagnosis.model.unit(output)) or "-",
                }
            )
    return rows


def _error(error: float, noise: float) -> dict:
    said = times(ratio(error, noise))
    return {"value": free_run_error(error), "times": "" if said == "diverges" else said}
