"""Records of machines whose laws are not those of their priors."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from sklearn.utils import check_random_state

from sklearn_pgnn.annotations import RandomState
from sklearn_pgnn.datasets.excitation import excite
from sklearn_pgnn.datasets.integrator import integrate
from sklearn_pgnn.datasets.rig import Rig, add_noise, find_amplitudes, make_tables, run_bounded
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.parameter import Parameter
from sklearn_pgnn.physics.systems import golf_robot, servo_valve

# -- a golf robot with stick-slip friction ---------------------------------------------------------

#: excitations of the records, in turn
EXCITATION = ("sine", "steps", "chirp")
#: sampling rate for the search for amplitudes [Hz]
TRIAL_RATE = 200.0
#: integration steps per second for the bristles, whose rate reaches 5000 per second
BRISTLE_RATE = 4000.0


def golf_robot_plant() -> PhysicsModel:
    r"""Return the true golf robot: LuGre friction, and parameters slightly off those of the prior.

    .. math::
        J \ddot\varphi &= -m g a \sin\varphi - d\,\dot\varphi
            - N (\sigma_0 z + \sigma_1 \dot z) + 4 u, \qquad
        N = \max(m a \dot\varphi^2 + m g \cos\varphi,\, 0) \\
        \dot z &= \dot\varphi - \frac{\sigma_0 |\dot\varphi|}{G(\dot\varphi)} z, \qquad
        G(\dot\varphi) = r\mu\,(0.95 + 0.55\, e^{-(\dot\varphi/v_s)^2})

    Compared with `golf_robot`: sliding friction 0.95 times, static friction 1.5 times, inertia 0.98
    times, gravity torque 1.02 times and damping 1.25 times as large. The bristles yield
    some mrad before the club slips, :math:`-\frac{G}{\sigma_0}\ln(1 - F/F_{max})`.

    Returns
    -------
    PhysicsModel
        As `golf_robot`, with the deflection ``z`` [rad] of the bristles as a third state.

    References
    ----------
    .. [1] C. Canudas de Wit, H. Olsson, K. J. Astrom, P. Lischinsky, "A new model for control of
       systems with friction", IEEE Transactions on Automatic Control 40(3), 1995,
       :doi:`10.1109/9.376053`.

    Examples
    --------
    >>> list(golf_robot_plant().states)
    ['phi', 'omega', 'z']
    """
    prior = golf_robot()
    slip = "(r*mu*(slide + peak*exp(-(omega/v_s)**2)))"
    rate = f"(omega - sigma0*abs(omega)*z/{slip})"
    friction = f"max(m*a*omega**2 + m*g*cos(phi), 0)*(sigma0*z + sigma1*{rate})"
    scaled = {"J": 0.98, "d": 1.25, "m": 1.02}
    own = [
        Parameter("slide", 0.95),
        Parameter("peak", 0.55),
        Parameter("v_s", 0.12, unit="rad/s"),
        Parameter("sigma0", 40.0, unit="m/rad"),
        Parameter("sigma1", 0.5, unit="m s/rad"),
    ]
    parameters = [
        p.with_value(scaled.get(name, 1.0) * p.value) for name, p in prior.parameters.items()
    ]
    return prior.replace(
        name="golf robot with stick-slip",
        states={**prior.states, "z": "rad"},
        parameters=[*parameters, *own],
        equations={
            "phi": "omega",
            "omega": f"(-m*g*a*sin(phi) - d*omega - {friction} + 4*torque)/J",
            "z": rate,
        },
        energy={},
    )


def make_golf_robot(
    n_records: int = 6,
    *,
    duration: float = 10.0,
    sample_rate: float = 1000.0,
    noise: float = 1e-3,
    excitation: str | Sequence[str] = EXCITATION,
    reference: bool = False,
    random_state: RandomState = 0,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Make records of the golf robot with stick-slip, the club always below the horizontal.

    The corresponding prior is `sklearn_pgnn.systems.golf_robot`; the machine is
    `golf_robot_plant`.

    Parameters
    ----------
    n_records : int, default=6
        Number of records.
    duration : float, default=10
        Length of a record [s].
    sample_rate : float, default=1000
        Sampling rate [Hz].
    noise : float, default=1e-3
        Standard deviation of the angle's measurement noise [rad].
    excitation : str or sequence of str, default=("sine", "steps", "chirp")
        Excitations, taken in turn; see `make_hidden_effect`.
    reference : bool, default=False
        Whether to return, instead of the records, one separate reference record: a multi-sine.
    random_state : int, RandomState instance or None, default=0
        Seed or generator for excitations and noise.

    Returns
    -------
    X : pandas.DataFrame
        Columns ``trajectory``, ``t`` [s], ``torque`` [N m], and ``phi`` [rad] and ``omega``
        [rad/s], known in the first row of a trajectory and NaN in the others.
    y : pandas.DataFrame
        The measured angle ``phi_measured`` [rad].

    Examples
    --------
    >>> X, y = make_golf_robot(n_records=1, duration=1)
    >>> X.shape, y.shape
    ((1000, 5), (1000, 1))
    """
    rng = check_random_state(random_state)
    prior, plant = golf_robot(), golf_robot_plant()
    if reference:
        # other numbers than those of the records with the same seed
        rng = np.random.RandomState(rng.randint(2**31))
        n_records, excitation = 1, "multisine"
    t = np.arange(round(duration * sample_rate)) / sample_rate
    substeps = int(np.ceil(BRISTLE_RATE / sample_rate))
    rig = Rig(t, excite(excitation, t, n_records, 1, rng), np.zeros(1), substeps)
    stride = max(1, round(sample_rate / TRIAL_RATE))
    trial = Rig(t[::stride], rig.waves[:, ::stride], rig.offset)
    amplitudes = find_amplitudes(trial, prior, rng.uniform(0.6, 1.0, n_records))
    amplitudes, x, y = run_bounded(rig, plant, plant, amplitudes)
    measured = add_noise(prior, y, noise, rng)
    return make_tables(prior, t, rig.inputs(amplitudes), x[:, 0, :2], measured)


# -- a servo valve with a limited slider -----------------------------------------------------------

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
