"""Find what is wrong with a physical model, mend it, and say what the mending is worth.

Every public name is imported when it is first used, so that the import itself stays light.
"""

from importlib import import_module

__version__ = "0.1.0.dev0"

_OBJECTS = {
    "Effect": "sklearn_pgnn.physics",
    "ModelDiagnosis": "sklearn_pgnn.diagnosis",
    "PGNNLRegressor": "sklearn_pgnn.estimators.pgnnl",
    "Parameter": "sklearn_pgnn.physics",
    "PhysicsModel": "sklearn_pgnn.physics",
    "PhysicsModelRegressor": "sklearn_pgnn.estimators",
    "PhysicsModelTransformer": "sklearn_pgnn.preprocessing",
    "ResidualRegressor": "sklearn_pgnn.estimators",
    "SINDYcRegressor": "sklearn_pgnn.estimators.sindyc",
    "make_pgnn_pipeline": "sklearn_pgnn.pipeline",
}
_MODULES = {
    "datasets": "sklearn_pgnn.datasets",
    "effects": "sklearn_pgnn.physics.effects",
    "inspection": "sklearn_pgnn.inspection",
    "model_selection": "sklearn_pgnn.model_selection",
    "network": "sklearn_pgnn.estimators.network",
    "systems": "sklearn_pgnn.physics.systems",
}

__all__ = sorted(["__version__", *_OBJECTS, *_MODULES])


def __getattr__(name):
    if name in _OBJECTS:
        value = getattr(import_module(_OBJECTS[name]), name)
    elif name in _MODULES:
        value = import_module(_MODULES[name])
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__():
    return __all__
