"""The package's own errors and warnings."""


class ModelError(ValueError):
    """A model, an equation or a model file is not valid.

    Parameters
    ----------
    message : str
        What was expected, what came, and where.
    where : tuple of str, default=()
        Which entry of the model is meant, e.g. ``("equations", "omega")``.
    """

    def __init__(self, message, where=()):
        super().__init__(message)
        self.where = tuple(where)


class RecordError(ValueError):
    """A record (a table of samples, a CSV file) cannot be used."""


class OptionError(ValueError):
    """An option (a keyword of an estimator or of the command line) is not valid."""


class RecordWarning(UserWarning):
    """A record is used with a change or a reservation, which the message gives with its remedy."""


class UnitWarning(UserWarning):
    """An equation of a model file does not fit its units; the message names the term."""


class SimulationError(RuntimeError):
    """A simulation left the finite numbers; the message says where, when and the remedy."""


class SimulationWarning(RuntimeWarning):
    """A simulation left the finite numbers and its remaining samples are NaN."""
