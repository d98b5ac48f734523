"""Parameters and effects that act as an input does, if the input is a function of the states."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np
import sympy

from sklearn_pgnn.physics.effects import CATALOGUE
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.record_quality.limits import ROWS, SHARE, TWICE
from sklearn_pgnn.simulation.pointwise import evaluate_samples, sample_table
from sklearn_pgnn.simulation.windows import ShootingWindows


def imitators(
    model: PhysicsModel, windows: ShootingWindows, x: np.ndarray, name: str, left: float
) -> tuple[str, ...]:
    r"""Return the parameters and effects that together act as a gain of an input does.

    A gain of the input :math:`u` changes rates and outputs, :math:`f`, by
    :math:`u\,\partial f/\partial u`, a parameter :math:`p` by :math:`\partial f/\partial p`. Over
    free states and inputs these are independent where :math:`\partial f/\partial p` does not
    contain :math:`u`; with :math:`u = h(x)` they need not be. A few are sought, one after the
    other, whose span holds the first at the samples of the records but for twice what that of all
    leaves, or the law of the input.

    >>> cart = PhysicsModel({"x": "m", "v": "m/s"}, {"x": "v", "v": "(F - k*x - d*v)/m"},
    ...                     {"m": 2.0, "d": 1.0, "k": 10.0}, {"F": "N"}, inertia={"v": "m"})
    >>> x = np.random.default_rng(0).normal(size=(100, 2))
    >>> u = (x @ [-3.0, -2.0])[:, None]
    >>> ends = np.array([0, 100])
    >>> records = ShootingWindows(np.arange(100.0), u, x, ends, ends[:1], ends[1:], np.ones(2))
    >>> imitators(cart, records, x, "F", left=1e-6)
    ('d', 'k')
    """
    gain, parts = _directions(model, windows, x, name)
    power = float(gain @ gain)
    least = _rest(gain, list(parts.values()))
    if least > SHARE * power:
        return ()
    enough = TWICE * max(least, left * power)
    found: list[str] = []
    while _rest(gain, [parts[p] for p in found]) > enough:
        found.append(min(parts, key=lambda p: _rest(gain, [parts[q] for q in (*found, p)])))
    for part in tuple(found):
        fewer = [p for p in found if p != part]
        if _rest(gain, [parts[p] for p in fewer]) <= enough:
            found = fewer
    return tuple(sorted(found))


def _rest(gain: np.ndarray, columns: Sequence[np.ndarray]) -> float:
    """Return the power of what lies outside a span, up to rounding."""
    if not columns:
        return float(gain @ gain)
    span = np.column_stack(columns)
    span = span / np.linalg.norm(span, axis=0)
    rest = gain - span @ np.linalg.lstsq(span, gain, rcond=None)[0]
    return float(max(rest @ rest, np.finfo(float).eps * (gain @ gain)))


def _directions(
    model: PhysicsModel, windows: ShootingWindows, x: np.ndarray, name: str
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return what a gain of an input, and what each part that does not contain it, changes."""
    u, acting = symbol(name), replace(windows, u=windows.acting_inputs(model))
    table = sample_table(model, acting, x)
    step = -(-windows.t.size // ROWS)
    thinned = {k: v[::step] if np.ndim(v) else v for k, v in table.items()}
    size = thinned["t"].size
    expressions = list(chain(model.equations.values(), model.outputs.values()))
    scale = [_rms(evaluate_samples(e, thinned, size)) for e in expressions]

    def column(slopes: Sequence[sympy.Expr]) -> np.ndarray:
        scaled = zip(slopes, scale, strict=True)
        return np.concatenate([evaluate_samples(e, thinned, size) / s for e, s in scaled])

    gain = column([u * sympy.diff(e, u) for e in expressions])
    parts = {}
    for part, slopes in _parts(model):
        if not any(u in slope.free_symbols for slope in slopes):
            found = column(slopes)
            if np.isfinite(found).all() and found.any():
                parts[part] = found
    return gain, parts


def _parts(model: PhysicsModel) -> Iterator[tuple[str, list[sympy.Expr]]]:
    """Yield the name, the slopes and the values of what may be off: parameters first."""
    for name in model.free_parameters:
        yield name, _slopes(model, name)
    moving = {*model.states, *model.ports}
    for effect in CATALOGUE:
        for target in effect.targets(model):
            names = tuple(effect(target).names().values())
            if target in moving and len(names) == 1 and names[0] not in model.parameters:
                extended = effect(target).apply(model)
                slopes = _slopes(extended, names[0])
                if extended.states == model.states and not any(
                    symbol(names[0]) in slope.free_symbols for slope in slopes
                ):
                    yield f"{effect.id.replace('_', ' ')} on {target}", slopes


def _slopes(model: PhysicsModel, name: str) -> list[sympy.Expr]:
    expressions = chain(model.equations.values(), model.outputs.values())
    return [sympy.diff(expression, symbol(name)) for expression in expressions]


def _rms(values: np.ndarray) -> float:
    """Return the root mean square, or 1 of what is always zero."""
    return float(np.sqrt(np.mean(values**2))) or 1.0
