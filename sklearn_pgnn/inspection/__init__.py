"""Plots of a diagnosis, and the report; the only subpackage that uses matplotlib."""

from sklearn_pgnn.inspection.candidates_display import CandidatesDisplay
from sklearn_pgnn.inspection.characteristic_display import CharacteristicDisplay
from sklearn_pgnn.inspection.detectability_display import DetectabilityDisplay, plot_detectability
from sklearn_pgnn.inspection.diagnosis_comparison import DiagnosisComparison, compare
from sklearn_pgnn.inspection.display import DiagnosisDisplay, plot_diagnosis
from sklearn_pgnn.inspection.first_look import FirstLook, first_look
from sklearn_pgnn.inspection.fit_percentage import fit_percentage
from sklearn_pgnn.inspection.missing_efforts import missing_efforts
from sklearn_pgnn.inspection.parameters_display import ParametersDisplay
from sklearn_pgnn.inspection.report import Provenance, SourceFile, render_report, write_report
from sklearn_pgnn.inspection.residual_display import ResidualDisplay, resid
from sklearn_pgnn.inspection.simulation_display import SimulationDisplay

__all__ = [
    "CandidatesDisplay",
    "CharacteristicDisplay",
    "DetectabilityDisplay",
    "DiagnosisComparison",
    "DiagnosisDisplay",
    "FirstLook",
    "ParametersDisplay",
    "Provenance",
    "ResidualDisplay",
    "SimulationDisplay",
    "SourceFile",
    "compare",
    "first_look",
    "fit_percentage",
    "missing_efforts",
    "plot_detectability",
    "plot_diagnosis",
    "render_report",
    "resid",
    "write_report",
]
