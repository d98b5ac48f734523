"""How large a hidden effect must be to matter: found by trial on short windows.

An effect of size 0 does nothing, one of size 1 is as large as the motion itself (a force as large
as the typical inertial force, a bias as large as the input's variation, a delay as long as a
window). The length of a window is the time that the slowest state takes to change: three times its
spread over its typical rate.
"""

import numpy as np
import sympy

from sklearn_pgnn.datasets.integrator import integrate
from sklearn_pgnn.datasets.rig import settled
from sklearn_pgnn.physics.effect import Scales
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.places import signals_at_ports
from sklearn_pgnn.physics.scales import typical_value

#: length of a window in the slowest state's time of change, its largest fraction of a record, and
#: the number of windows
CHANGES, SHARE, WINDOWS = 3.0, 0.25, 40
#: change that an effect should cause in the outputs on a window, in multiples of the noise
MATTERS = (10.0, 40.0)
#: sizes tried, and rounds of bisection between them
SMALLEST, BISECTIONS = 1e-3, 7
#: effects whose size may have either sign
EITHER_SIGN = frozenset({"constant_load", "input_bias", "sensor_bias", "sensor_gain"})


def _below_peak(size: float, scale) -> float:
    """Return a limit that clips more of a signal's peaks for a larger effect."""
    return scale["peak"] - size * min(0.7 * scale["peak"], 2 * scale["target"])


def _soft(size: float, scale) -> float:
    """Return the stiffness of a joint that gives more for a larger effect."""
    return 2.0 * scale["force"] / scale["position"] / size


#: parameters that are not in proportion to the size: value from size and the signals' scales
SHAPES = {
    ("stribeck_friction", "level"): lambda size, scale: 0.3 * size * scale["force"],
    ("stribeck_friction", "velocity"): lambda size, scale: 0.1 * scale["velocity"],
    ("asymmetric_friction", "level_backward"): lambda size, scale: 0.3 * size * scale["force"],
    ("asymmetric_friction", "viscous_backward"): lambda size, scale: (
        0.3 * size * scale["force"] / scale["velocity"]
    ),
    ("cogging", "period"): lambda size, scale: 0.5 * scale["position"],
    ("input_saturation", "limit"): _below_peak,
    ("input_dead_zone", "threshold"): lambda size, scale: 0.6 * size * scale["peak"],
    ("input_gain", "error"): lambda size, scale: 0.5 * size,
    ("input_rate_limit", "limit"): lambda size, scale: scale["target"] / (size * scale["s"]),
    ("input_rate_limit", "time_constant"): lambda size, scale: scale["step"],
    ("input_backlash", "time_constant"): lambda size, scale: scale["step"],
    ("periodic_disturbance", "frequency"): lambda size, scale: 2.3 / scale["s"],
    ("hysteresis", "deflection"): lambda size, scale: 0.1 * scale["position"],
    ("hysteresis", "shape"): lambda size, scale: 0.5,
    ("hysteretic_spring", "loss"): lambda size, scale: 0.7 / scale["position"],
    ("hysteretic_spring", "bend"): lambda size, scale: -0.4 / scale["position"],
    ("elastic_joint", "share"): lambda size, scale: 0.3,
    ("elastic_joint", "stiffness"): _soft,
    ("elastic_joint", "damping"): lambda size, scale: 0.05 * scale["force"] / scale["velocity"],
    ("joint_play", "share"): lambda size, scale: 0.3,
    ("joint_play", "stiffness"): _soft,
    ("joint_play", "damping"): lambda size, scale: 0.05 * scale["force"] / scale["velocity"],
    ("joint_play", "width"): lambda size, scale: 0.3 * size * scale["position"],
    ("spring_play", "width"): lambda size, scale: 2.0 * size * scale["position"],
    ("end_stop", "upper"): lambda size, scale: scale["position"] * (2.0 - 1.5 * size),
    ("end_stop", "lower"): lambda size, scale: -scale["position"] * (2.0 - 1.5 * size),
    ("end_stop", "stiffness"): lambda size, scale: 20.0 * scale["force"] / scale["position"],
    ("rate_limit", "limit"): lambda size, scale: 3.0 * scale["rate"] * (1.0 - 0.95 * size),
    ("state_limit", "limit"): _below_peak,
    ("state_limit", "steepness"): lambda size, scale: 20.0 / scale["s"],
    ("overflow", "limit"): _below_peak,
    ("overflow", "steepness"): lambda size, scale: 20.0 / scale["s"],
    ("overflow", "share"): lambda size, scale: 0.5,
    ("sensor_curvature", "curvature"): lambda size, scale: 0.4 * size / scale["peak"],
    ("sensor_saturation", "upper"): _below_peak,
    ("sensor_saturation", "lower"): lambda size, scale: -scale["peak"],
    ("sensor_delay", "delay"): lambda size, scale: 0.3 * size * scale["s"],
    ("load_friction", "level"): lambda size, scale: 0.3 * size * scale["force"],
    ("load_friction", "share"): lambda size, scale: 0.6 * size,
    ("gear_loss", "level"): lambda size, scale: 0.3 * size * scale["force"],
    ("gear_loss", "share"): lambda size, scale: 0.2 * size,
    ("gear_loss", "backward"): lambda size, scale: 0.8 * size,
    ("load_stribeck_friction", "level"): lambda size, scale: 0.3 * size * scale["force"],
    ("load_stribeck_friction", "share"): lambda size, scale: 0.3 * size,
    ("load_stribeck_friction", "peak"): lambda size, scale: 1.0,
    ("load_stribeck_friction", "velocity"): lambda size, scale: 0.1 * scale["velocity"],
    ("input_fading", "fading"): lambda size, scale: 0.9 * size * scale["per_signal"],
    ("asymmetric_dead_zone", "above"): lambda size, scale: 0.6 * size * scale["peak"],
    ("asymmetric_dead_zone", "below"): lambda size, scale: 0.2 * size * scale["peak"],
    ("leak_to_level", "level"): lambda size, scale: 0.5 * scale["peak"],
    ("parameter_slope", "slope"): lambda size, scale: 0.9 * size * scale["per_signal"],
    ("parameter_saturation", "bend"): lambda size, scale: 3.0 * size * scale["per_signal"],
    ("parameter_drift", "rate"): lambda size, scale: 2.0 * size / scale["duration"],
    ("second_store", "time_constant"): lambda size, scale: 0.3 * scale["s"],
    ("store_between", "time_constant"): lambda size, scale: 0.5 * size * scale["s"],
    ("store_between", "ratio"): lambda size, scale: 2.0,
    ("maxwell_branch", "time_constant"): lambda size, scale: 0.1 * scale["s"],
    ("relaxation_branch", "time_constant"): lambda size, scale: 0.2 * scale["s"],
    ("two_relaxation_branches", "time_constant"): lambda size, scale: 0.05 * scale["s"],
    ("two_relaxation_branches", "ratio"): lambda size, scale: 8.0,
    ("sensor_lag", "time_constant"): lambda size, scale: 0.3 * size * scale["s"],
    ("power_loss", "power"): lambda size, scale: 0.5,
    ("radiation_loss", "coefficient"): lambda size, scale: size / (4 * 300.0**3 * scale["s"]),
    ("input_power", "power"): lambda size, scale: -0.8 * size,
    ("input_power", "reference"): lambda size, scale: 0.5 * scale["peak"],
    ("input_curve", "below"): lambda size, scale: -0.9 * size,
    ("input_curve", "above"): lambda size, scale: -0.9 * size,
    ("input_curve", "first"): lambda size, scale: 0.25 * scale["peak"],
    ("input_curve", "second"): lambda size, scale: 0.65 * scale["peak"],
}

#: quantities that span a signal to both its sides, as multiples of what is typical of one
SPANS = {("input_backlash", "width"): 2.0}


def measure_scales(model, t, u, x, y) -> Scales:
    """Measure magnitudes in records: arrays of shape (n_records, n_samples, n)."""
    signals = {
        name: values[..., i]
        for names, values in ((model.outputs, y), (model.states, x), (model.inputs, u))
        for i, name in enumerate(names)
    }
    at_ports = {name: _signal(model, each, x) for name, each in signals_at_ports(model).items()}
    signals |= at_ports
    rates = np.gradient(x, t, axis=1)
    changes = np.std(x, axis=(0, 1)) / np.maximum(_rms(rates), np.finfo(float).tiny)
    return Scales(
        typical={name: float(np.std(signal)) for name, signal in signals.items()},
        peak={name: float(np.abs(signal).max()) for name, signal in signals.items()},
        rate=dict(zip(model.states, _rms(rates).tolist(), strict=True))
        | {name: float(_rms(np.gradient(s, t, axis=1))) for name, s in at_ports.items()},
        sample_time=float(np.median(np.diff(t))),
        window=float(min(CHANGES * changes.max(), SHARE * (t[-1] - t[0]))),
        duration=float(t[-1] - t[0]),
        latest=float(t[-1]),
    )


def family(kind, target: str, model, scales: Scales, rng):
    """Draw an effect, its sign and proportions, as a function of its size."""
    sign = rng.choice([-1.0, 1.0])
    if kind.id == "wrong_parameter":
        own = model.parameters[target]  # changed by at least a fifth
        return lambda size: kind(
            target, value=float(np.clip(own.value * (1 + sign * (0.2 + 0.5 * size)), *own.bounds))
        )
    scale = kind.typical(target, model, scales) | {
        "rate": scales.rate.get(target, 1.0),
        "duration": scales.duration,
        "step": scales.sample_time,
        "peak": scales.peak.get(target, 1.0),
    }
    scale = {key: max(value, 1e-12) for key, value in scale.items()}
    shares = {f.name: rng.uniform(0.6, 1.0) for f in kind.quantities()}
    sign = sign if kind.id in EITHER_SIGN else 1.0

    def value(quantity, size):
        shape, about = SHAPES.get((kind.id, quantity.name)), quantity.metadata
        if shape is not None:
            return shape(size, scale)
        number = sign * size * shares[quantity.name] * typical_value(about["unit"], scale)
        number *= SPANS.get((kind.id, quantity.name), 1.0)
        return np.clip(number, about["low"], about["high"])

    return lambda size: kind(target, **{f.name: float(value(f, size)) for f in kind.quantities()})


def draw_size(effect, model, t, u, x, scales: Scales, floor, rng, substeps: int = 1):
    """Bisect an effect's size until it matters on windows; return it, and whether it does."""
    wanted = np.exp(rng.uniform(*np.log(MATTERS)))
    windows = _windows(t, u, x, scales.window, rng)
    without = integrate(model, *windows, substeps=substeps)[1]

    def does(size):
        return _difference(model, effect(size), windows, without, floor, substeps)

    largest = does(1.0)
    if largest < wanted:
        return effect(1.0), bool(largest >= MATTERS[0])
    low, high = SMALLEST, 1.0
    for _ in range(BISECTIONS):
        middle = np.sqrt(low * high)
        low, high = (low, middle) if does(middle) > wanted else (middle, high)
    return effect(high), True


def _signal(model, expression, x):
    """Return an expression of states and parameters in a set of records."""
    values = {symbol(name): p.value for name, p in model.parameters.items()}
    function = sympy.lambdify(list(map(symbol, model.states)), expression.xreplace(values))
    return function(*np.moveaxis(x, -1, 0))


def _rms(signals):
    """Return the root mean square of every quantity over records and samples."""
    return np.sqrt(np.mean(np.square(signals), axis=(0, 1)))


def _windows(t, u, x, window, rng):
    """Draw random windows: times, inputs and initial states."""
    n_records, n_samples = u.shape[:2]
    length = min(n_samples, max(10, int(np.searchsorted(t - t[0], window))))
    records = rng.randint(n_records, size=WINDOWS)
    starts = rng.randint(n_samples - length + 1, size=WINDOWS)
    rows = starts[:, None] + np.arange(length)
    return t[:length], u[records[:, None], rows], x[records, starts]


def _difference(model, effect, windows, without, floor, substeps):
    """Return the change of the outputs on the windows by an effect, in multiples of the noise."""
    t, u, x0 = windows
    plant = model + effect
    added = len(plant.states) - len(model.states)
    start = settled(plant, model.states, np.pad(x0, ((0, 0), (0, added))), u[:, 0])
    y = integrate(plant, t, u, start, substeps=substeps)[1]
    ratio = np.sqrt(np.mean((y - without) ** 2, axis=(0, 1))) / floor
    return np.inf if np.isnan(ratio).any() else ratio.max()
