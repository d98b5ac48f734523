"""Judgement: which physical cause a model misses, and what naming it is worth."""

from sklearn_pgnn.diagnosis.model_diagnosis import ModelDiagnosis

__all__ = ["ModelDiagnosis"]
