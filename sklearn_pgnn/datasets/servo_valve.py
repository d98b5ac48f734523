"""Records of a servo valve with a limited slider."""

import numpy as np
import pandas as pd
from sklearn.utils import check_random_state

from sklearn_pgnn.annotations import RandomState
from sklearn_pgnn.datasets.integrator import integrate
from sklearn_pgnn.datasets.records import add_noise, make_tables
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.parameter import Parameter
from sklearn_pgnn.physics.systems import servo_valve

#: steps in a record, and integration steps per second needed for the stops
LEVELS, STEP_RATE = 4, 40_000.0


def servo_valve_plant() -> PhysicsModel:
    r"""Return the true servo valve: limited velocity, acceleration and travel, uneven gain.

    .. math::
        \dot y &= \min(\max(v, -v_-), v_+) \\
        \dot v &= a_{max} \tanh\left(\frac{\omega^2 (K_+ u + K_- |u| - y) - 2 D \omega v}
            {a_{max}}\right) - \omega_s^2\,\mathrm{over}(y) - 2 \omega_s v [|y| > s]

    with the stops at :math:`\pm s`, stiff and well damped, and
    :math:`\mathrm{over}(y) = \max(y - s, 0) + \min(y + s, 0)`. Position and velocity are in units
    of the largest position, as in `servo_valve`.

    Returns
    -------
    PhysicsModel
        As `servo_valve`, with other parameters and the limits.

    Notes
    -----
    The limits are assumptions: 335 Hz, +200 and -185 per second, 9e5 per second squared, stops at
    0.98, and a gain 6 % lower for negative voltages. The paper names the limits but no values.

    Examples
    --------
    >>> servo_valve_plant().parameters["stop"].value
    0.98
    """
    prior = servo_valve()
    voltage = "(K_V*(0.97*voltage + 0.03*abs(voltage)))"
    free = f"((2*pi*f_V)**2*({voltage} - y) - 4*pi*f_V*D_V*v)"
    over = "(max(y - stop, 0) + min(y + stop, 0))"
    touching = "(1 + sign(abs(y) - stop))/2"
    own = [
        Parameter("v_forward", 200.0, unit="1/s"),
        Parameter("v_backward", 185.0, unit="1/s"),
        Parameter("a_max", 9e5, unit="1/s^2"),
        Parameter("stop", 0.98),
        Parameter("w_stop", 6000.0, unit="1/s"),
    ]
    return prior.replace(
        name="servo valve with limits and stops",
        parameters=[
            *prior.with_parameters(f_V=335.0).parameters.values(),
            *own,
        ],
        equations={
            "y": "max(min(v, v_forward), -v_backward)",
            "v": f"a_max*tanh({free}/a_max) - w_stop**2*{over} - 2*w_stop*v*{touching}",
        },
        energy={},
    )


def make_servo_valve(
    n_records: int = 10,
    *,
    duration: float = 0.12,
    sample_rate: float = 2000.0,
    noise: float = 2e-3,
    reference: bool = False,
    random_state: RandomState = 0,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Make step records of the servo valve with limits.

    The corresponding priors are `sklearn_pgnn.systems.servo_valve` with and without limits;
    the machine is `servo_valve_plant`.

    Parameters
    ----------
    n_records : int, default=10
        Number of records.
    duration : float, default=0.12
        Length of a record [s].
    sample_rate : float, default=2000
        Sampling rate [Hz].
    noise : float, default=2e-3
        Standard deviation of the position's measurement noise [largest position].
    reference : bool, default=False
        Whether to return, instead of the records, one separate reference record: up to 5 V and
        back.
    random_state : int, RandomState instance or None, default=0
        Seed or generator for voltages and noise.

    Returns
    -------
    X : pandas.DataFrame
        Columns ``trajectory``, ``t`` [s], ``voltage`` [V], and ``y`` and ``v`` [1/s], known in
        the first row of a trajectory and NaN in the others.
    y : pandas.DataFrame
        The measured position ``y_measured``.

    Examples
    --------
    >>> X, y = make_servo_valve(n_records=2)
    >>> X.shape, y.shape
    ((480, 5), (480, 1))
    """
    rng = check_random_state(random_state)
    plant = servo_valve_plant()
    t = np.arange(round(duration * sample_rate)) / sample_rate
    if reference:
        voltage = np.where((t >= 0.1 * duration) & (t < 0.6 * duration), 5.0, 0.0)[None]
    else:
        voltage = np.stack([_steps(t, duration, rng) for _ in range(n_records)])
    u = voltage[..., None]
    x, y = integrate(plant, t, u, substeps=int(np.ceil(STEP_RATE / sample_rate)))
    return make_tables(servo_valve(), t, u, x[:, 0], add_noise(servo_valve(), y, noise, rng))


def _steps(t, duration, rng):
    """Start at 0 V, then hold levels between -10 and 10 V for about equal times."""
    levels = np.append(0.0, rng.uniform(-10, 10, LEVELS))
    edges = (np.arange(LEVELS) + rng.uniform(0.1, 0.5, LEVELS)) * duration / LEVELS
    return levels[np.searchsorted(edges, t, side="right")]
