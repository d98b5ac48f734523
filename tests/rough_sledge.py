"""A diagnosed sledge whose model misses its dry friction, shared by tests of what is shown."""

from functools import lru_cache

from sledge import SLEDGE, drive

from sklearn_pgnn import ModelDiagnosis, effects


@lru_cache(maxsize=1)
def rough_sledge():
    """Return a diagnosis, and the X and y that it was fitted on."""
    X, y = drive(SLEDGE + effects.CoulombFriction("v", level=0.3))
    catalogue = (effects.CoulombFriction, effects.InputBias, effects.QuadraticDrag)
    return ModelDiagnosis(SLEDGE, catalogue=catalogue).fit(X, y), X, y
