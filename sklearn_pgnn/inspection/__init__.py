"""Pictures of a diagnosis, and the report; the only room of matplotlib."""

from sklearn_pgnn.inspection.display import DiagnosisDisplay, plot_diagnosis

__all__ = ["DiagnosisDisplay", "plot_diagnosis"]
