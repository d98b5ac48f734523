"""An effect as a function of one size: from nothing to as large as the motion itself."""

from collections.abc import Callable

from sklearn_pgnn.physics.effect import Effect, Scales
from sklearn_pgnn.physics.effects import WrongParameter
from sklearn_pgnn.physics.effects.typical import typical_by_kind, typical_value
from sklearn_pgnn.physics.model import PhysicsModel

#: quantities that say over what an effect acts, not how strongly
SHAPES = frozenset(
    {"velocity", "period", "frequency", "phase", "exponent", "order", "deflection", "shape"}
)
#: a default from here on means that a limit is never reached
ENDLESS = 1e6
#: of several strengths the first is taken whole and the others in this share
BESIDE = 0.5


def sized(
    kind: type[Effect], target: str, model: PhysicsModel, scales: Scales
) -> Callable[[float], Effect]:
    """Give an effect as a function of its size.

    Size 0 does nothing. Size 1 is a force as large as the typical inertial force, a bias or a dead
    zone as large as the signal's ups and downs, a limit that lets nothing through, a delay as long
    as a window, a parameter of twice its value, or 1 where that is 0. Quantities like a period take
    the middle of the values a diagnosis would start from.

    Parameters
    ----------
    kind : type of Effect
        The effect.
    target : str
        What it acts on.
    model : PhysicsModel
        The model to extend.
    scales : Scales
        How large the signals of the records are.

    Returns
    -------
    callable
        The effect of a size between 0 and 1.

    Examples
    --------
    >>> from sklearn_pgnn.physics.effects import InputSaturation
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> scales = Scales({"u": 1.0, "y": 1.0}, {"u": 2.0, "y": 2.0}, {"y": 1.0}, 0.01, 1.0)
    >>> sized(InputSaturation, "u", lag, scales)(0.25)
    InputSaturation(target='u', limit=1.5)
    """
    if issubclass(kind, WrongParameter):
        return _wrong_parameter(kind, model.parameters[target])
    scale = typical_by_kind(target, model, scales)
    limits = kind.limits(target, model, scales)
    starts = kind.starts(target, model, scales)
    usual = starts[len(starts) // 2]
    first, ends = main_field(kind), any(_is_end(f) for f in kind.quantities())

    def value(quantity, size):
        about, name = quantity.metadata, quantity.name
        if _is_end(quantity):
            wanted = _end(quantity, getattr(usual, name), limits[name], size)
        elif ends or name in SHAPES or (name == "time_constant" and name != first):
            return getattr(usual, name)
        else:
            share = 1.0 if name == first else BESIDE
            wanted = share * size * typical_value(about["unit"], scale)
        low, high = limits.get(name, (about["low"], about["high"]))
        return float(min(max(wanted, about["low"], low), about["high"], high))

    return lambda size: kind(target, **{f.name: value(f, size) for f in kind.quantities()})


def has_size(kind: type[Effect]) -> bool:
    """Tell whether an effect may be smaller or larger, or is there or not."""
    return issubclass(kind, WrongParameter) or bool(kind.quantities())


def main_field(kind: type[Effect]) -> str:
    """Give the field that tells how strong an effect is.

    Parameters
    ----------
    kind : type of Effect
        The effect.

    Returns
    -------
    str
        The first of its quantities that is a strength.
    """
    if issubclass(kind, WrongParameter):
        return "value"
    return next(f.name for f in kind.quantities() if f.name not in SHAPES)


def nothing(kind: type[Effect], target: str, model: PhysicsModel, scales: Scales) -> float:
    """Give the value of `main_field` at which an effect does nothing.

    Parameters
    ----------
    kind : type of Effect
        The effect.
    target : str
        What it acts on.
    model : PhysicsModel
        The model to extend.
    scales : Scales
        How large the signals of the records are.

    Returns
    -------
    float
        The value.
    """
    if issubclass(kind, WrongParameter):
        return model.parameters[target].value
    main = next(f for f in kind.quantities() if f.name == main_field(kind))
    return kind.limits(target, model, scales)[main.name][1] if _is_end(main) else 0.0


def _is_end(quantity) -> bool:
    """Tell whether a quantity is where something ends, so that large means nothing."""
    return abs(quantity.default) >= ENDLESS


def _end(quantity, usual, limits, size) -> float:
    """Give an end: of a range, in proportion; of a rate, the usual one at half the size."""
    if "/s" in quantity.metadata["unit"] or "rate" in quantity.metadata["unit"]:
        return usual * (1.0 - size) / max(size, 1e-9)
    return (1.0 - size) * (limits[1] if quantity.default > 0 else limits[0])


def _wrong_parameter(kind, parameter):
    low, high = parameter.bounds
    change = parameter.value or 1.0

    def of_size(size):
        return kind(parameter.name, value=min(max(parameter.value + size * change, low), high))

    return of_size
