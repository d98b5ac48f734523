"""Find what is wrong with a physical model, correct it, and measure what the correction is worth.

Every public name is imported on first use, so that importing the package stays fast.

`PGNNLRegressor`, `make_pgnn_pipeline` and `network` need the extra ``network``: without it they
are not listed, and accessing one raises an error that names the command to install it. The same
holds on use without their extras for `SINDYcRegressor` (``sindy``), `model_selection.search_space`
(``tuning``) and the loaders of public benchmarks in `datasets` (``benchmarks``).
"""

from importlib import import_module
from typing import Any

from sklearn_pgnn.extras import is_installed

__version__ = "0.1.0.dev0"

_OBJECTS = {
    "ConformalRegressor": "sklearn_pgnn.prediction",
    "Effect": "sklearn_pgnn.physics",
    "EnsembleRegressor": "sklearn_pgnn.prediction",
    "FleetDiagnosis": "sklearn_pgnn.fleet",
    "GreyBoxRegressor": "sklearn_pgnn.grey_box",
    "ModelDiagnosis": "sklearn_pgnn.diagnosis",
    "PGNNLRegressor": "sklearn_pgnn.estimators.pgnnl",
    "Parameter": "sklearn_pgnn.physics",
    "PhysicsModel": "sklearn_pgnn.physics",
    "PhysicsModelRegressor": "sklearn_pgnn.estimators",
    "PhysicsModelTransformer": "sklearn_pgnn.preprocessing",
    "Port": "sklearn_pgnn.physics",
    "ResidualRegressor": "sklearn_pgnn.estimators",
    "SINDYcRegressor": "sklearn_pgnn.estimators.sindyc",
    "make_pgnn_pipeline": "sklearn_pgnn.pipeline",
}
_MODULES = (
    "datasets",
    "diagnosis",
    "effects",
    "exceptions",
    "export",
    "fleet",
    "inspection",
    "model_selection",
    "network",
    "priors",
    "simulation",
    "systems",
)
#: the names that cannot be imported without the extra "network"
_OF_NETWORK = {"PGNNLRegressor", "make_pgnn_pipeline", "network"}

__all__ = sorted({"__version__", *_OBJECTS, *_MODULES})
if not is_installed("network"):
    __all__ = [name for name in __all__ if name not in _OF_NETWORK]


def __getattr__(name: str) -> Any:
    if name in _OBJECTS:
        value = getattr(import_module(_OBJECTS[name]), name)
    elif name in _MODULES:
        value = import_module(f"{__name__}.{name}")
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
