r"""Inputs as the time loop needs them: on the record's clock, delays applied.

A delayed input under zero-order hold changes inside a sample interval. The loop gets its mean over
the interval, :math:`\frac{1}{\Delta t}\int u(\theta - \tau)\,d\theta`, which is continuous in the
delay :math:`\tau` and keeps the step's impulse exact; under first-order hold it gets
:math:`u(t_k - \tau)`. Before the record begins an input has its first value.
"""

import numpy as np

from sklearn_pgnn.physics.model import PhysicsModel


def delayed_inputs(model: PhysicsModel, t, u, linear_hold: bool = False):
    """Shift the late inputs and append their derivatives by the delay.

    Return inputs as they act, then for every late one its derivative by the delay, of shape
    (n_samples, n_inputs + n_delays). The model's `delays` and parameter values count; `linear_hold`
    is whether the inputs are interpolated linearly between samples instead of being held.
    """
    if not model.delays:
        return u
    shift = _linear if linear_hold else _held
    acting, slopes = u.copy(), []
    for name, delay in model.delays.items():
        i = list(model.inputs).index(name)
        acting[:, i], slope = shift(t, u[:, i], model.parameters[delay].value)
        slopes.append(slope)
    return np.ascontiguousarray(np.column_stack([acting, *slopes]))


def mean_inputs(t, u, kept, bounds):
    """Average held inputs (n_kept, n_inputs) from every kept sample of a record to the next."""
    width = np.diff(t, append=t[-1:])
    last = np.asarray(bounds)[1:] - 1
    width[last] = width[np.maximum(last - 1, 0)]
    area = np.add.reduceat(width[:, None] * u, kept)
    return area / np.add.reduceat(width, kept)[:, None]


def _held(t, u, delay):
    """Average a held input over every interval, and differentiate by the delay."""
    end = t[-1] + (t[-1] - t[-2] if t.size > 1 else 1.0)
    edges = np.append(t, end)
    integral = np.concatenate([[0.0], np.cumsum(u * np.diff(edges))])
    late = edges - delay
    area = np.interp(late, edges, integral) + np.minimum(late - edges[0], 0.0) * u[0]
    width = np.diff(edges)
    at = u[np.clip(np.searchsorted(edges, late, side="right") - 1, 0, u.size - 1)]
    return np.diff(area) / width, -np.diff(at) / width


def _linear(t, u, delay):
    """Interpolate, and differentiate by the delay."""
    late = t - delay
    k = np.clip(np.searchsorted(t, late, side="right") - 1, 0, max(t.size - 2, 0))
    slope = np.diff(u)[k] / np.diff(t)[k] if t.size > 1 else np.zeros_like(u)
    return np.interp(late, t, u), np.where(late < t[0], 0.0, -slope)
