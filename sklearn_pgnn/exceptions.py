"""The package's own errors and warnings."""


class ModelError(ValueError):
    """A model, an equation or a model file does not say what it must."""


class RecordError(ValueError):
    """A record (a table of samples, a CSV file) cannot be used."""


class SimulationError(RuntimeError):
    """A simulation left the finite numbers; the message says where, when and the remedy."""


class SimulationWarning(RuntimeWarning):
    """A simulation left the finite numbers and its remaining samples are NaN."""
