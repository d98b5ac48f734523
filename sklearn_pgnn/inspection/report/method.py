"""How a diagnosis was made, and with which versions."""

import platform
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version

from sklearn_pgnn.inspection.numbers import number, percent
from sklearn_pgnn.physics.channel_kinds import in_words

LIBRARIES = ("numpy", "scipy", "sympy", "numba", "scikit-learn")


def method(diagnosis) -> str:
    """Return how it was done."""
    records, window = diagnosis.records_, diagnosis.window_
    count, samples = len(records.names), records.windows.t.size
    length = f"{number(window, 3)} s"
    return (
        f"{samples} samples in {count} {'record' if count == 1 else 'records'} were cut into "
        f"{len(records.windows)} windows of about {length}, each with an initial state of "
        f"its own. Every candidate was fitted together with the model's free parameters and these "
        f"initial states. A cause is named only if a likelihood ratio on windows its parameters "
        f"were not fitted to supports it, at a false-alarm rate of {diagnosis.alpha:g}; if it "
        f"explains {percent(diagnosis.smallest_share)} of an output's error or more; and if the "
        f"free run does not contradict it. Inputs: {_hold(diagnosis.hold_)}; "
        f"integration steps from sample to sample: {diagnosis.substeps_}. "
        f"Intervals are 95 % intervals, robust to residuals that are not white. The noise of an "
        f"output is the white part of what the extended model leaves of it over windows."
        f"{_channels(diagnosis.model)}"
    )


def _channels(model) -> str:
    """Return which faults were left out, where the model says what its channels are."""
    if not model.channels:
        return ""
    return f" Only faults that the channels can have were tried: {in_words(model)}."


def _hold(hold: str) -> str:
    return "held between samples" if hold == "zoh" else "linearly interpolated between samples"


def versions() -> str:
    """Return the versions of the package, of Python and of its main dependencies."""
    package = import_module(__name__.split(".")[0])
    used = ", ".join(f"{name} {_version(name)}" for name in LIBRARIES)
    return f"sklearn-pgnn {package.__version__} (Python {platform.python_version()}, {used})"


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "of unknown version"
