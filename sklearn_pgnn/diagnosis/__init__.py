"""Diagnosis: which physical causes a model lacks, and how much each reduces its error."""

from sklearn_pgnn.diagnosis.free_run import FreeRunError
from sklearn_pgnn.diagnosis.model_diagnosis import ModelDiagnosis
from sklearn_pgnn.diagnosis.result import (
    Gain,
    NamedCause,
    RetunedParameter,
    Rival,
    Tried,
)
from sklearn_pgnn.diagnosis.structure import Structure
from sklearn_pgnn.diagnosis.unexplained import MissingPart
from sklearn_pgnn.diagnosis.verdict import Remaining
from sklearn_pgnn.estimation.candidate import Candidate
from sklearn_pgnn.experiment_design.detectability import Detectability, Detectable
from sklearn_pgnn.experiment_design.separation import Experiment, Separation
from sklearn_pgnn.record_quality.finding import Finding

__all__ = [
    "Candidate",
    "Detectability",
    "Detectable",
    "Experiment",
    "Finding",
    "FreeRunError",
    "Gain",
    "MissingPart",
    "ModelDiagnosis",
    "NamedCause",
    "Remaining",
    "RetunedParameter",
    "Rival",
    "Separation",
    "Structure",
    "Tried",
]
