"""A diagnosis as plain data, as in ``diagnosis.json``."""

from typing import TYPE_CHECKING

from sklearn_pgnn.diagnosis.result import NamedCause
from sklearn_pgnn.estimation.plain_data import finite, plain
from sklearn_pgnn.experiment_design.separation import plain_separation
from sklearn_pgnn.physics.effects import find_effect

if TYPE_CHECKING:
    from sklearn_pgnn.diagnosis.model_diagnosis import ModelDiagnosis


def plain_diagnosis(diagnosis: "ModelDiagnosis") -> dict:
    """Return a diagnosis as plain data; non-finite numbers are None."""
    unexplained = diagnosis.discrepancy_
    found = {
        "verdict": diagnosis.verdict_,
        "data_quality": [finding.to_dict() for finding in diagnosis.data_quality_],
        "causes": [_plain_cause(cause) for cause in diagnosis.causes_],
        "groups": {column: list(names) for column, names in diagnosis.groups_.items()},
        "separations": [plain_separation(found) for found in diagnosis.separations_],
        "parameters": {name: plain(p) for name, p in diagnosis.parameters_.items()},
        "gain": {name: plain(gain) for name, gain in diagnosis.gain_.items()},
        "free_run": {name: plain(error) for name, error in diagnosis.free_run_.items()},
        "initial_states": _named_starts(diagnosis),
        "unexplained": None if unexplained is None else unexplained.to_dict(),
        "remaining": plain(diagnosis.remaining_),
        "unusable": [plain(candidate) for candidate in diagnosis.unusable_],
        "stopped": diagnosis.stopped_,
        "complete": diagnosis.complete_,
        "tested": diagnosis.tested_,
        "window": diagnosis.window_,
        "hold": diagnosis.hold_,
        "substeps": diagnosis.substeps_,
    }
    return finite(found)


def _plain_cause(cause: NamedCause) -> dict:
    """Return a named cause as plain data, with whether each rival is equivalent to it."""
    return {
        "effect": cause.effect,
        "target": cause.target,
        "name": find_effect(cause.effect).title(cause.target),
        "parameters": {name: plain(found) for name, found in cause.parameters.items()},
        "gain_percent": cause.gain,
        "probability": cause.probability,
        "outside_catalogue": cause.outside,
        "tested": cause.tested,
        "onset": None if cause.onset is None else plain(cause.onset),
        "confused_with": [
            {**plain(other), "equivalent": other[:2] in cause.equivalent}
            for other in cause.confused_with
        ],
    }


def _named_starts(diagnosis: "ModelDiagnosis") -> list[dict]:
    """Return every trajectory's name and initial state."""
    states = list(diagnosis.extended_model_.states)
    return [
        {"trajectory": name, "state": dict(zip(states, start.tolist(), strict=True))}
        for name, start in zip(diagnosis.records_.names, diagnosis.initial_states_, strict=True)
    ]
