"""Transformers for scikit-learn's pipelines."""

from sklearn_pgnn.preprocessing.physics_model_transformer import PhysicsModelTransformer

__all__ = ["PhysicsModelTransformer"]
