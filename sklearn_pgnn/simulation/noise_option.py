"""The noise of the outputs as given by a user."""

from collections.abc import Sequence

import numpy as np

from sklearn_pgnn.exceptions import OptionError


def read_noise_std(noise_std, outputs: Sequence[str]) -> np.ndarray | None:
    """Return the given noise, one number per output, or None; else raise `OptionError`.

    >>> read_noise_std(0.01, ["position"])
    array([0.01])
    >>> read_noise_std(0.01, ["position", "speed"])
    Traceback (most recent call last):
        ...
    sklearn_pgnn.exceptions.OptionError: noise_std: expected 2 finite numbers above 0, one for \
each output (position, speed), got 0.01. Remedy: ...
    """
    if noise_std is None:
        return None
    try:
        values = np.array(noise_std, dtype=float)
    except (TypeError, ValueError):  # a word, or lists of several lengths
        values = np.empty(0)
    values = values[None] if values.ndim == 0 else values
    if values.shape != (len(outputs),) or not np.all((values > 0) & np.isfinite(values)):
        _refuse(noise_std, outputs)
    return values


def _refuse(noise_std, outputs: Sequence[str]):
    many = f"{len(outputs)} finite numbers above 0, one for each output ({', '.join(outputs)})"
    one = f"one finite number above 0, for the output {outputs[0]}"
    raise OptionError(
        f"noise_std: expected {one if len(outputs) == 1 else many}, got {noise_std!r}. Remedy: "
        f"give the standard deviation of each output's noise in the output's own unit, or omit it: "
        f"it is then estimated from the records."
    )
