"""The report of a diagnosis: one self-contained HTML file."""

from sklearn_pgnn.inspection.report.page import render_report, write_report
from sklearn_pgnn.inspection.report.provenance import Provenance, SourceFile

__all__ = ["Provenance", "SourceFile", "render_report", "write_report"]
