"""Errors and warnings of the package."""

import re


class ModelError(ValueError):
    """A model, an equation or a model file is not valid.

    Parameters
    ----------
    message : str
        What was expected, what was given, and where.
    where : tuple of str, default=()
        Path of the entry in the model, e.g. ``("equations", "omega")``.

    Examples
    --------
    >>> from sklearn_pgnn import PhysicsModel
    >>> try:
    ...     PhysicsModel({"x": "m"}, {"x": "-x/T"})
    ... except ModelError as error:
    ...     print(error)
    equations.x: unknown name 'T'; known names are x ...
    """

    def __init__(self, message: str, where: tuple[str, ...] = ()):
        super().__init__(message)
        self.where = tuple(where)


class RecordError(ValueError):
    """A record (a table of samples, a CSV file) cannot be used.

    Examples
    --------
    >>> from sklearn_pgnn import systems, trajectories
    >>> try:
    ...     trajectories.read_file("forgotten.csv", systems.cart_on_spring())
    ... except RecordError as error:
    ...     print(error)
    forgotten.csv:1: expected a CSV file, got: No such file...
    """


class OptionError(ValueError):
    """An option (a keyword of an estimator or of the command line) is not valid.

    Examples
    --------
    >>> from sklearn_pgnn import ModelDiagnosis, systems
    >>> cart = systems.cart_on_spring()
    >>> try:
    ...     ModelDiagnosis(cart, hold="soh").fit([[0.0, 0.0]], [0.0])
    ... except OptionError as error:
    ...     print(error)
    hold: expected one of auto, zoh, foh, got 'soh'.
    """


class RecordWarning(UserWarning):
    """A record is used with a change or a reservation; the message states it and the remedy.

    Examples
    --------
    >>> import warnings
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("error", RecordWarning)  # a reservation ends what is done here
    """


class DiagnosisWarning(UserWarning):
    """A stage of a diagnosis, or a part of its report, failed; the rest is kept.

    Its ``__cause__`` is the error.

    Examples
    --------
    >>> import warnings
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("error", DiagnosisWarning)  # raised once the results are kept
    """


class ModelWarning(UserWarning):
    """A model is used with a reservation; the message states it and the remedy.

    Examples
    --------
    >>> import warnings
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("ignore", ModelWarning)  # it was read, and is wanted
    """


class FitWarning(UserWarning):
    """A fit has ended with a reservation; the message states it and the remedy.

    Examples
    --------
    >>> import warnings
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("error", FitWarning)  # what is not determined ends a script
    """


class UnitWarning(ModelWarning):
    """The units of an equation in a model file are inconsistent; the message names the term.

    Examples
    --------
    >>> import warnings
    >>> from sklearn_pgnn import PhysicsModel
    >>> _ = PhysicsModel({"v": "m/s"}, {"v": "F"}, inputs={"F": "N"}).to_yaml("cart.yaml")
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("error", UnitWarning)
    ...     try:
    ...         model = PhysicsModel.from_yaml("cart.yaml")
    ...     except UnitWarning as warning:
    ...         print(warning)
    cart.yaml:7:3: equations.v: the term F is in N, expected m/s^2. Remedy: ...
    """


class SimulationError(RuntimeError):
    """A simulation became non-finite; the message says where, when and the remedy.

    Examples
    --------
    >>> from sklearn_pgnn import PhysicsModel
    >>> explosion = PhysicsModel({"x": "m"}, {"x": "x**2"}, initial_state={"x": 1.0})
    >>> try:
    ...     explosion.simulate([0, 1, 2, 3, 4]).check()
    ... except SimulationError as error:
    ...     print(error)
    the simulation of 'model' became non-finite at t = 2 s (sample 2; before: ...
    """


class TrainingError(ValueError):
    """A network's training became non-finite; the message says in which epoch and the remedy.

    Examples
    --------
    >>> from sklearn_pgnn import GreyBoxRegressor, PGNNLRegressor, systems
    >>> wild = PGNNLRegressor(lr=1e300)  # its training diverges, and the recipe does without it
    >>> grey_box = GreyBoxRegressor(systems.cart_on_spring(), network=wild)
    """


#: errors that mean unusable input and recur at every attempt; any other error is a bug
UNUSABLE = (ModelError, RecordError, OptionError, SimulationError)


class SimulationWarning(RuntimeWarning):
    """A simulation became non-finite and its remaining samples are NaN.

    Examples
    --------
    >>> import warnings
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("error", SimulationWarning)  # end where one diverges
    """


def code_of(kind: type[BaseException]) -> str:
    """Return the code that ``sklearn-pgnn explain`` takes for a class of errors or warnings.

    >>> code_of(ModelError)
    'model_error'
    """
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", kind.__name__).lower()
