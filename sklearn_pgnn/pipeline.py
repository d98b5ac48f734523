"""Simulation, scaling and network in one pipeline."""

from typing import Any, Self

from sklearn.compose import ColumnTransformer
from sklearn.pipeline import Pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_pgnn.annotations import Table
from sklearn_pgnn.estimators.pgnnl import PGNNLRegressor
from sklearn_pgnn.exceptions import OptionError
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.preprocessing import PhysicsModelTransformer
from sklearn_pgnn.trajectories.tables import SIMULATED
from sklearn_pgnn.trajectories.validation import check_model


class NamedColumns(ColumnTransformer):
    """A `ColumnTransformer` whose result has names, by which the network reads it."""

    def set_output(self, *, transform: str | None = None) -> Self:
        """Choose the library of the table; an array, which has no names, is refused."""
        if transform == "default":
            raise OptionError(
                "transform: expected 'pandas' or 'polars', for the network reads the columns of "
                "the scaled table by their names, got 'default'. Remedy: "
                "set_output(transform='pandas'), as the pipeline was made."
            )
        return super().set_output(transform=transform)


def simulated_columns(X: Table) -> list[str]:
    """Return the names of the simulated columns of a table."""
    return [name for name in X.columns if name.endswith(SIMULATED)]


def make_pgnn_pipeline(
    model: PhysicsModel, *, memory: Any = None, verbose: int = 0, **network: Any
) -> Pipeline:
    """Build the paper's pipeline: simulate the model, scale the simulation, train a network.

    Only the simulated columns are standardised. Time, inputs and initial states pass the scaler
    untouched, so that the energies of the physical loss are in physical units.

    Parameters
    ----------
    model : PhysicsModel
        The model.
    memory : str or joblib.Memory, optional
        Where the simulation is cached, so that a search does not repeat it.
    verbose : int, default=0
        Whether to print the times of the steps, and the network's phases and epochs.
    **network
        Parameters of `PGNNLRegressor`.

    Returns
    -------
    Pipeline
        With the steps ``physics``, ``scale`` and ``network``; its X is a DataFrame or an array.
        Between the steps are tables of pandas, or of polars after ``set_output``.

    Examples
    --------
    >>> from sklearn_pgnn import systems
    >>> pipeline = make_pgnn_pipeline(systems.golf_robot(), module__neurons=5)
    >>> list(pipeline.named_steps)
    ['physics', 'scale', 'network']
    """
    check_model(model)
    scale = NamedColumns(
        [("simulation", StandardScaler(), simulated_columns)],
        remainder="passthrough",
        verbose_feature_names_out=False,
    )
    steps = [
        ("physics", PhysicsModelTransformer(model, append="all").set_output(transform="pandas")),
        ("scale", scale.set_output(transform="pandas")),
        ("network", PGNNLRegressor(model, verbose=verbose, **network)),
    ]
    return Pipeline(steps, memory=memory, verbose=bool(verbose))
