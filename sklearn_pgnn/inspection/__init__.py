"""Plots of a diagnosis, and the report; the only subpackage that uses matplotlib."""

from sklearn_pgnn.inspection.diagnosis_comparison import DiagnosisComparison, compare
from sklearn_pgnn.inspection.display import DiagnosisDisplay, plot_diagnosis
from sklearn_pgnn.inspection.displays import (
    CandidatesDisplay,
    CharacteristicDisplay,
    DetectabilityDisplay,
    ParametersDisplay,
    plot_detectability,
)
from sklearn_pgnn.inspection.first_look import FirstLook, first_look
from sklearn_pgnn.inspection.missing_efforts import missing_efforts
from sklearn_pgnn.inspection.report import Provenance, SourceFile, render_report, write_report
from sklearn_pgnn.inspection.run_displays import ResidualDisplay, SimulationDisplay, resid
from sklearn_pgnn.inspection.run_files import simulated_records
from sklearn_pgnn.inspection.runs import fit_percentage
from sklearn_pgnn.record_quality.identifiability import Identifiability, identifiability

__all__ = [
    "CandidatesDisplay",
    "CharacteristicDisplay",
    "DetectabilityDisplay",
    "DiagnosisComparison",
    "DiagnosisDisplay",
    "FirstLook",
    "Identifiability",
    "ParametersDisplay",
    "Provenance",
    "ResidualDisplay",
    "SimulationDisplay",
    "SourceFile",
    "compare",
    "first_look",
    "fit_percentage",
    "identifiability",
    "missing_efforts",
    "plot_detectability",
    "plot_diagnosis",
    "render_report",
    "resid",
    "simulated_records",
    "write_report",
]
