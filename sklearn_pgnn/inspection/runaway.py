"""A model that runs away from the records within windows, in words."""

import numpy as np

from sklearn_pgnn.estimation.without_model import free_values, squares_without_model
from sklearn_pgnn.inspection.numbers import number
from sklearn_pgnn.record_quality.finding import listed

#: what to do about a model that runs away
REMEDY = (
    "Check the signs, units and values of the model, and give wider spreads to parameters that are "
    "not well known. If the machine is unstable by itself, sample faster: in windows of a few "
    "samples the model cannot run away. If a controller holds it against a load, record the load; "
    "or put the controller into the model, with the reference as the input."
)


def runaway_sentence(diagnosis) -> str:
    """Return what was expected of the model, what came, and where."""
    came = [
        f"{number(gain.refitted, 3)} {gain.unit}".rstrip() + f" of {output} instead of less than "
        f"{number(expected, 3)}"
        for (output, gain), expected in zip(
            diagnosis.gain_.items(), _without_model(diagnosis), strict=True
        )
    ]
    return (
        f"Nothing can be told: over windows of {number(diagnosis.window_, 3)} s the re-tuned model "
        f"runs away from the records, as that of an unstable machine does, or of one that a "
        f"controller holds against a load that is not recorded. It predicts no output "
        f"better than is possible without a model, by carrying on as at the start: its error is "
        f"{listed(came)}. No cause is named that merely ends the divergence."
    )


def runaway_remedy(diagnosis) -> str:
    """Return what to do about a model that runs away.

    The first sentence is on windows of a given length.
    """
    given = "" if diagnosis.window_length is None else "Leave window_length out. "
    return f"{given}{REMEDY}"


def _without_model(diagnosis) -> np.ndarray:
    """Return the root mean square error that is possible without a model, of every output."""
    windows = diagnosis.records_.windows
    counts = np.isfinite(windows.y[windows.rows]).sum(axis=0)
    squares = squares_without_model(windows, free_values(diagnosis.model))
    return windows.scale * np.sqrt(squares / np.maximum(counts, 1))
