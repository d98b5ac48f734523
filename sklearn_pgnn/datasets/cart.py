"""Records of a cart on a spring with a hidden effect."""

from typing import Any

from sklearn.utils import check_random_state

from sklearn_pgnn.annotations import RandomState
from sklearn_pgnn.datasets.hidden_effect import HiddenEffect, make_hidden_effect
from sklearn_pgnn.physics.systems import cart_on_spring


def make_cart(
    n_records: int = 6,
    *,
    effect: Any = "cubic_stiffness",
    duration: float = 10.0,
    sample_rate: float = 200.0,
    noise: float = 1e-3,
    parameter_error: float = 0.05,
    random_state: RandomState = 0,
) -> HiddenEffect:
    r"""Make records of a cart on a spring, :math:`m \ddot x = F - k x - d \dot x - \text{effect}`.

    Parameters
    ----------
    n_records : int, default=6
        Number of records.
    effect : Effect, str, a sequence of both, or None, default="cubic_stiffness"
        Hidden effect, as in `make_hidden_effect`; by default the spring hardens.
    duration : float, default=10
        Length of a record [s].
    sample_rate : float, default=200
        Sampling rate [Hz].
    noise : float, default=1e-3
        Standard deviation of the position's measurement noise [m].
    parameter_error : float, default=0.05
        Largest relative error of the prior's parameters.
    random_state : int, RandomState instance or None, default=0
        Seed or generator for all random draws.

    Returns
    -------
    HiddenEffect
        The records, the prior, the truth and the effects.

    Examples
    --------
    >>> make_cart(n_records=1, duration=2).effect.id
    'cubic_stiffness'
    """
    return make_hidden_effect(
        cart_on_spring(),
        effect,
        n_records=n_records,
        duration=duration,
        sample_rate=sample_rate,
        noise=noise,
        parameter_error=parameter_error,
        random_state=check_random_state(random_state),
    )
