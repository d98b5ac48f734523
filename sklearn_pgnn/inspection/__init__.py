"""Pictures of a diagnosis, and the report; the only subpackage that uses matplotlib."""

from sklearn_pgnn.inspection.detectability_display import DetectabilityDisplay, plot_detectability
from sklearn_pgnn.inspection.display import DiagnosisDisplay, plot_diagnosis
from sklearn_pgnn.inspection.first_look import FirstLook, first_look
from sklearn_pgnn.inspection.fit_percentage import fit_percentage
from sklearn_pgnn.inspection.report import write_report

__all__ = [
    "DetectabilityDisplay",
    "DiagnosisDisplay",
    "FirstLook",
    "first_look",
    "fit_percentage",
    "plot_detectability",
    "plot_diagnosis",
    "write_report",
]
