"""Simulation, scaling and network in one pipeline."""

from sklearn.compose import ColumnTransformer, make_column_selector
from sklearn.pipeline import Pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_pgnn.estimators.pgnnl import PGNNLRegressor
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.preprocessing import PhysicsModelTransformer
from sklearn_pgnn.trajectories.validation import check_model


def make_pgnn_pipeline(model: PhysicsModel, *, memory=None, verbose=0, **network) -> Pipeline:
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

    Examples
    --------
    >>> from sklearn_pgnn import systems
    >>> pipeline = make_pgnn_pipeline(systems.golf_robot(), module__neurons=5)
    >>> list(pipeline.named_steps)
    ['physics', 'scale', 'network']
    """
    check_model(model)
    scale = ColumnTransformer(
        [("simulation", StandardScaler(), make_column_selector(pattern="_phy$"))],
        remainder="passthrough",
        verbose_feature_names_out=False,
    )
    steps = [
        ("physics", PhysicsModelTransformer(model, append="all").set_output(transform="pandas")),
        ("scale", scale.set_output(transform="pandas")),
        ("network", PGNNLRegressor(model, verbose=verbose, **network)),
    ]
    return Pipeline(steps, memory=memory, verbose=bool(verbose))
