"""Dead sensors: outputs that never change in a record though the model moves there."""

import numpy as np

from sklearn_pgnn.record_quality.finding import Finding
from sklearn_pgnn.record_quality.limits import TWICE
from sklearn_pgnn.record_quality.signals import Signal
from sklearn_pgnn.record_quality.wording import listed
from sklearn_pgnn.trajectories.constant_outputs import SEVERAL


def find_dead_sensor(signal: Signal, residual: Signal) -> Finding | None:
    """Find records in which an output has one value only, and a fitted model clearly others.

    A machine at rest is no fault: its model rests, too.
    """
    still = signal.is_still
    if all(still):
        return None
    least = TWICE * max(signal.noise, signal.resolution, signal.finest)
    rows = zip(still, signal.records, signal.pieces, residual.pieces, strict=True)
    dead = {
        record: signal.measured(float(np.nanmax(piece)))
        for is_still, record, piece, rest in rows
        if is_still and np.isfinite(piece).sum() >= SEVERAL and np.sqrt(np.nanmean(rest**2)) > least
    }
    if not dead:
        return None
    places = listed(f"record {record} ({value})" for record, value in dead.items())
    return Finding(
        "dead sensor",
        signal.name,
        f"{signal.name} has one value only throughout {places}, where the model moves",
        float(len(dead)),
        "look at the sensor and its cable, and leave the output empty (NaN) in these records; if "
        "the machine was stuck there, that is what the model lacks",
    )
