"""Records of a machine with physical effects that the engineer's model lacks."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from sklearn.utils import check_random_state

from sklearn_pgnn.annotations import RandomState
from sklearn_pgnn.datasets.excitation import excite
from sklearn_pgnn.datasets.rig import (
    Rig,
    add_noise,
    find_amplitudes,
    make_tables,
    noise_levels,
    resting_input,
    run_bounded,
)
from sklearn_pgnn.datasets.sizes import draw_size, family, measure_scales
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.effects import CATALOGUE, InputDeadZone
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.systems import cart_on_spring, golf_robot, two_tanks

#: default noise of an output for sizing effects, as a fraction of its standard deviation
QUIET = 1e-3


@dataclass(frozen=True)
class HiddenEffect:
    """Records, the model handed to the engineer, and the truth.

    Parameters
    ----------
    X : pandas.DataFrame
        Columns ``trajectory``, ``t``, the inputs and the states; the states are known in the
        first row of a trajectory and NaN in the others.
    y : pandas.DataFrame
        The measured outputs.
    prior : PhysicsModel
        The model handed to the engineer: without the effects, and with slightly wrong parameters.
    truth : PhysicsModel
        The true machine.
    effects : tuple of Effect
        The hidden effects; empty if there are none.

    Examples
    --------
    >>> from sklearn_pgnn import datasets, systems
    >>> rig = datasets.make_hidden_effect(
    ...     systems.cart_on_spring(), "coulomb_friction", n_records=1, duration=1.0, random_state=0
    ... )
    >>> [effect.id for effect in rig.effects], len(rig.X) == len(rig.y)
    (['coulomb_friction'], True)
    """

    X: pd.DataFrame
    y: pd.DataFrame
    prior: PhysicsModel
    truth: PhysicsModel
    effects: tuple[Effect, ...]

    @property
    def effect(self) -> Effect | None:
        """The first of the hidden effects, None if there is none."""
        return self.effects[0] if self.effects else None


def make_hidden_effect(
    model: PhysicsModel | None = None,
    effect: Any = None,
    *,
    n_records: int = 8,
    duration: float = 10.0,
    sample_rate: float = 500.0,
    noise: float | Mapping[str, float] = 1e-3,
    parameter_error: float = 0.07,
    excitation: str | Sequence[str] = "mixed",
    amplitude: float | None = None,
    substeps: int | None = None,
    random_state: RandomState = None,
) -> HiddenEffect:
    r"""Make records of a machine that differs from its model by one or several hidden effects.

    .. math:: \dot x = f(x, u, p) + \text{effects}, \qquad y_k = g(x_k, u_k) + e_k,
        \qquad p_\text{prior} = p\,(1 + \epsilon)

    The machine is simulated by a separate integrator, not by `sklearn_pgnn.simulation`.

    Parameters
    ----------
    model : PhysicsModel, optional
        The machine without the effects; by default `golf_robot`.
    effect : Effect, str, a sequence of both, or None, default=None
        An effect, used as given; the id of an effect, whose target and size are drawn so that,
        alone, it changes the outputs on short windows by 10 to 40 times the noise; ``"random"`` for
        one drawn from the catalogue; several of these, applied one after the other; None for no
        effect.
    n_records : int, default=8
        Number of records.
    duration : float, default=10
        Length of a record [s].
    sample_rate : float, default=500
        Sampling rate [Hz].
    noise : float or mapping of str to float, default=1e-3
        Standard deviation of the measurement noise [output], common or per output.
    parameter_error : float, default=0.07
        Largest relative error of the prior's parameters; those marked as fixed have none.
    excitation : str or sequence of str, default="mixed"
        ``"multisine"``, ``"sine"``, ``"chirp"``, ``"steps"``, or several taken in turn record by
        record; ``"mixed"`` stands for multisine, chirp and steps.
    amplitude : float, optional
        Amplitude of the inputs about the value that holds the initial state. By default, the
        amplitude of every record is such that the first output moves by half to all of its reach
        (1.2 rad, 70 deg, or 1 of any other unit); with the effect, it is lowered for records beyond
        1.2 times the reach, and raised for those that hardly move.
    substeps : int, optional
        Integration steps per sample interval, by default as given by the model's `simulation`,
        else 2; a stiff machine needs more. Amplitudes and sizes are found with half of them.
    random_state : int, RandomState instance or None, default=None
        Seed or generator for all random draws.

    Returns
    -------
    HiddenEffect
        The records, the prior, the truth and the effects.

    Raises
    ------
    ModelError
        If two effects are of the same kind on the same target.
    ValueError
        If an effect is unknown, the model has no target for it, or a number is out of range.

    Examples
    --------
    >>> hidden = make_hidden_effect(effect="input_bias", n_records=1, duration=2, sample_rate=100,
    ...                             random_state=0)
    >>> hidden.effect.id
    'input_bias'
    >>> list(hidden.X.columns)
    ['trajectory', 't', 'torque', 'phi', 'omega']
    >>> hidden.prior.parameters["J"].value == hidden.truth.parameters["J"].value
    False
    """
    _check(n_records, duration, sample_rate, parameter_error)
    rng = check_random_state(random_state)
    model = golf_robot() if model is None else model
    t = np.arange(max(2, round(duration * sample_rate))) / sample_rate
    waves = excite(excitation, t, n_records, len(model.inputs), rng)
    substeps = model.simulation.get("substeps", 2) if substeps is None else substeps
    rig = Rig(t, waves, resting_input(model), substeps)
    trial = replace(rig, substeps=max(1, substeps // 2))
    goals = rng.uniform(0.5, 1.0, n_records)
    if amplitude is None:
        amplitudes = find_amplitudes(trial, model, goals)
    else:
        amplitudes = np.full(goals.size, float(amplitude))
    floor, truth = noise_levels(model, noise), model
    effects = tuple(_choose(e, model, trial, amplitudes, floor, rng) for e in _listed(effect))
    for hidden in effects:
        truth = truth + hidden
    if amplitude is None:
        amplitudes, x, y = run_bounded(rig, truth, model, amplitudes)
    else:
        x, y = rig.run(truth, amplitudes, states=model.states)
    _check_finite(t, y)
    x0 = x[:, 0, : len(model.states)]
    measured = add_noise(model, y, noise, rng)
    X, y = make_tables(model, t, rig.inputs(amplitudes), x0, measured)
    return HiddenEffect(X, y, perturb(model, parameter_error, rng), truth, effects)


def _check_finite(t, y) -> None:
    """Raise an error if a record became non-finite."""
    lost = ~np.isfinite(y).all(axis=2)
    if lost.any():
        record, sample = np.argwhere(lost)[0]
        raise ValueError(
            f"effect: expected a machine that can be simulated, but record {record} becomes "
            f"non-finite at t = {t[sample]:.4g} s. Remedy: a smaller effect or amplitude."
        )


def perturb(model, error: float, rng):
    r"""Perturb every free parameter by a random factor :math:`1 + \epsilon`, within its bounds.

    `error` is the largest :math:`|\epsilon|`.

    >>> model = perturb(golf_robot(), 0.05, np.random.RandomState(0))
    >>> 0.95 < model.parameters["J"].value / 0.1445 < 1.05
    True
    """
    values = {}
    for name in model.free_parameters:
        parameter = model.parameters[name]
        value = parameter.value * (1 + rng.uniform(-error, error))
        values[name] = float(np.clip(value, *parameter.bounds))
    return model.with_parameters(**values)


def _listed(effect) -> tuple:
    """Return the effects to hide as a tuple."""
    if effect is None:
        return ()
    several = isinstance(effect, Sequence) and not isinstance(effect, str)
    return tuple(effect) if several else (effect,)


def _choose(effect, model, rig, amplitudes, noise, rng):
    """Return the effect to hide; target and size are drawn if not given."""
    if isinstance(effect, Effect):
        return effect
    x, y = rig.run(model, amplitudes)
    u = rig.inputs(amplitudes)
    scales = measure_scales(model, rig.t, u, x, y)
    floor = np.where(noise > 0, noise, QUIET * y.std(axis=(0, 1)) + np.finfo(float).tiny)
    kind = _kind(effect, model, rng)
    for target in rng.permutation(kind.targets(model)):
        open_size = family(kind, str(target), model, scales, rng)
        chosen, matters = draw_size(open_size, model, rig.t, u, x, scales, floor, rng, rig.substeps)
        if matters:
            break
    return chosen


def _kind(effect, model, rng):
    """Return an effect by its id, or draw one for which the model has a target."""
    kinds = {kind.id: kind for kind in CATALOGUE if kind.targets(model)}
    if isinstance(effect, str) and effect == "random":
        return kinds[rng.choice(sorted(kinds))]
    if effect not in kinds:
        raise ValueError(
            f"effect: expected an Effect, None, 'random' or one of {', '.join(kinds)} "
            f"for {model.name!r}, got {effect!r}."
        )
    return kinds[effect]


def _check(n_records, duration, sample_rate, parameter_error):
    """Raise `ValueError` for numbers from which no records can be made."""
    for name, value in (
        ("n_records", n_records), ("duration", duration), ("sample_rate", sample_rate),
    ):  # fmt: skip
        if not value > 0:
            raise ValueError(f"{name}: expected a number > 0, got {value!r}.")
    if not 0 <= parameter_error < 1:
        raise ValueError(f"parameter_error: expected a number in [0, 1), got {parameter_error!r}.")


# -- a cart on a spring ----------------------------------------------------------------------------


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


# -- two tanks in cascade --------------------------------------------------------------------------

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
