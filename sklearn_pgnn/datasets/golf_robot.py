"""Records of a golf robot with stick-slip friction."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from sklearn.utils import check_random_state

from sklearn_pgnn.annotations import RandomState
from sklearn_pgnn.datasets.excitation import excite
from sklearn_pgnn.datasets.records import add_noise, make_tables
from sklearn_pgnn.datasets.rig import Rig, find_amplitudes, run_bounded
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.parameter import Parameter
from sklearn_pgnn.physics.systems import golf_robot

#: excitations of the records, in turn
EXCITATION = ("sine", "steps", "chirp")
#: sampling rate for the search for amplitudes [Hz]
TRIAL_RATE = 200.0


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
    rig = Rig(t, excite(excitation, t, n_records, 1, rng), np.zeros(1), _substeps(sample_rate))
    stride = max(1, round(sample_rate / TRIAL_RATE))
    trial = Rig(t[::stride], rig.waves[:, ::stride], rig.offset)
    amplitudes = find_amplitudes(trial, prior, rng.uniform(0.6, 1.0, n_records))
    amplitudes, x, y = run_bounded(rig, plant, plant, amplitudes)
    measured = add_noise(prior, y, noise, rng)
    return make_tables(prior, t, rig.inputs(amplitudes), x[:, 0, :2], measured)


def _substeps(sample_rate):
    """Return the substeps for the bristles, whose rate reaches 5000 per second: at least 4 kHz."""
    return int(np.ceil(4000.0 / sample_rate))
