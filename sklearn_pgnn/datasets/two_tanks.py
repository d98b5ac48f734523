"""Records of two tanks in cascade with a hidden effect of the pump."""

from typing import Any

from sklearn.utils import check_random_state

from sklearn_pgnn.annotations import RandomState
from sklearn_pgnn.datasets.hidden_effect import HiddenEffect, make_hidden_effect
from sklearn_pgnn.physics.effects import InputDeadZone
from sklearn_pgnn.physics.systems import two_tanks

#: amplitude of the pump about 3 V [V]: the input crosses the dead zone, and no tank runs empty
AMPLITUDE = 2.7


def make_two_tanks(
    n_records: int = 4,
    *,
    effect: Any = "dead zone",
    duration: float = 600.0,
    sample_rate: float = 1.0,
    noise: float = 0.01,
    parameter_error: float = 0.05,
    random_state: RandomState = 0,
) -> HiddenEffect:
    r"""Make records of two tanks, only the lower level measured, the pump between 0.3 and 5.7 V.

    .. math::
        \dot x_1 = -k_1 \sqrt{x_1} + k_4\,\mathrm{zone}(u),
        \qquad \dot x_2 = k_2 \sqrt{x_1} - k_3 \sqrt{x_2}

    Parameters
    ----------
    n_records : int, default=4
        Number of records.
    effect : Effect, str, a sequence of both, or None, default="dead zone"
        Hidden effect: by default a pump that does nothing below 0.8 V; otherwise as in
        `make_hidden_effect`.
    duration : float, default=600
        Length of a record [s].
    sample_rate : float, default=1
        Sampling rate [Hz].
    noise : float, default=0.01
        Standard deviation of the level's measurement noise [cm].
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
    >>> tanks = make_two_tanks(n_records=1, duration=200)
    >>> print(tanks.effect)
    InputDeadZone(target='pump', threshold=0.8)
    """
    if isinstance(effect, str) and effect == "dead zone":
        effect = InputDeadZone("pump", threshold=0.8)
    return make_hidden_effect(
        two_tanks(),
        effect,
        n_records=n_records,
        duration=duration,
        sample_rate=sample_rate,
        noise=noise,
        parameter_error=parameter_error,
        excitation=("multisine", "chirp"),
        amplitude=AMPLITUDE,
        random_state=check_random_state(random_state),
    )
