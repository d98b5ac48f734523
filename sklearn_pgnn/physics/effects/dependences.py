"""Parameters, and gains of inputs, that depend on a state or an input."""

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass

import sympy

from sklearn_pgnn.physics.characteristic import Characteristic
from sklearn_pgnn.physics.effect import Effect, Symbols, quantity
from sklearn_pgnn.physics.effects.inputs import substitute
from sklearn_pgnn.physics.effects.levels import first_order_states
from sklearn_pgnn.physics.effects.losses import ABSOLUTE
from sklearn_pgnn.physics.effects.rates import is_velocity, may_be_speed
from sklearn_pgnn.physics.effects.targets import pair, parts
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.scales import Scales
from sklearn_pgnn.physics.shown_states import told_states

#: a parameter keeps at least this fraction of its value
KEPT = 0.05
#: largest factor by which a parameter grows over the range of the signal that it depends on
GROWN = 20.0


@dataclass(frozen=True)
class ParameterDependence(Effect):
    """A parameter that is replaced by a function of itself and of a signal."""

    @classmethod
    def can_act(cls, target: str, model: PhysicsModel) -> bool:
        """Return whether the model has the parameter and the signal."""
        parameter, signal = parts(target)
        return parameter in model.parameters and signal in {*model.states, *model.inputs}

    @classmethod
    def factor(cls, target: str, model: PhysicsModel, p: Symbols) -> sympy.Expr:
        """Return by what the parameter is multiplied at a value of the signal."""
        raise NotImplementedError

    @classmethod
    def power(cls, target: str, model: PhysicsModel) -> int:
        """Return the power of the signal on which the parameter depends first."""
        return 1

    def rewrite(self, model: PhysicsModel, p: Symbols) -> dict:
        """Replace the parameter by its value as a function of the signal."""
        parameter = symbol(parts(self.target)[0])
        return substitute(model, parameter, parameter * self.factor(self.target, model, p))

    def units(self, model: PhysicsModel) -> dict[str, str]:
        """Return one over the unit of the signal's power."""
        unit, power = model.unit(parts(self.target)[1]), self.power(self.target, model)
        return {"per_signal": f"1/({unit}){f'^{power}' * (power > 1)}" if unit else ""}

    @classmethod
    def typical(cls, target: str, model: PhysicsModel, scales: Scales) -> dict[str, float]:
        """Return one over the power of the signal's largest magnitude."""
        peak = max(scales.peak[parts(target)[1]], 1e-300)
        return {"per_signal": 1.0 / peak ** cls.power(target, model)}

    def characteristic(self, model: PhysicsModel) -> Characteristic | None:
        """Return the parameter over the signal."""
        parameter, signal = map(symbol, parts(self.target))
        p = {key: symbol(name) for key, name in self.names().items()}
        law = parameter * self.factor(self.target, model, p)
        return Characteristic("parameter", str(parameter), signal, law=law)


@dataclass(frozen=True)
class ParameterSlope(ParameterDependence):
    r"""A parameter that changes in proportion to a signal, :math:`p\,(1 + a s)`.

    A diagnosis considers coefficients (the rates are linear in them) that depend on a measured
    state, or on an input that drives nothing, such as the room temperature; and any other
    parameter, as a resistance in a denominator or in an output, that depends on a measured
    first-order state or on such an input. Velocities and the signals that the coefficient itself
    multiplies are excluded: frictions, springs and `ParameterSaturation` cover those. The signal
    is measured from its zero.

    Parameters
    ----------
    target : str
        Parameter and signal, as ``"R(T)"``.
    slope : float, default=0
        Relative change :math:`a` [1/signal].

    Examples
    --------
    >>> from sklearn_pgnn.physics.systems import cart_on_spring
    >>> ParameterSlope.targets(cart_on_spring())
    ('d(x)',)
    >>> print((cart_on_spring() + ParameterSlope("d(x)", slope=0.1)).to_text().splitlines()[1])
    v' = (-d*v*(slope_d_x*x + 1) + force - k*x)/m
    """

    slope: float = quantity("slope", "{per_signal}")
    id = "parameter_slope"
    summary = "This parameter grows or falls with that signal: a resistance that grows with heat."
    check = "Hold the signal at two values, and identify the parameter at each."

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return parameters with measured signals that they do not multiply themselves."""
        signals = [signal for signal in _shown(model) if not _drives_or_moves(model, signal)]
        linear, stores = _coefficients(model), first_order_states(model)
        moved = {str(s) for mass in model.inertia.values() for s in mass.free_symbols}
        pairs = [(n, s) for n, by in linear.items() for s in signals if not _any_has(by, s)]
        pairs += [
            (n, s)
            for n in _others(model, linear)
            for s in signals
            if s in model.inputs or (s in stores and n not in moved and not _is_capacity(model, n))
        ]
        units = {name: known.unit for name, known in model.parameters.items()}
        return tuple(
            pair(n, s) for n, s in pairs if units[n] not in ABSOLUTE or units[n] != model.unit(s)
        )

    @classmethod
    def title(cls, target: str) -> str:
        """Return parameter and signal in words."""
        return "{} that changes with {}".format(*parts(target))

    @classmethod
    def factor(cls, target: str, model: PhysicsModel, p: Symbols) -> sympy.Expr:
        """Return 1 + a*s."""
        return 1 + p["slope"] * symbol(parts(target)[1])

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Keep the parameter's sign over the range of the signal."""
        low, high = scales.ends(parts(target)[1])
        most = GROWN / (max(abs(low), abs(high)) or 1.0)
        least = -(1 - KEPT) / high if high > 0 else -most
        return {"slope": (least, -(1 - KEPT) / low if low < 0 else most)}


@dataclass(frozen=True)
class ParameterSaturation(ParameterDependence):
    r"""A coefficient that depends on the magnitude of its signal, :math:`p/(1 + b |s|^n)`.

    Its term :math:`p\,s` levels off towards :math:`p/b`, as a motor's torque or an amplifier's
    output does (:math:`n = 1`); with a negative :math:`b` it grows ever more steeply, as a
    propeller's thrust over its voltage does. Candidates are the coefficients that multiply a
    function of a single measured signal. Forces of a velocity or of a position are not among them:
    they are friction, drag and springs. The inductance, capacity or time constant by which the
    whole rate of a measured state is divided, with that state and with the input of a plain lag,
    are. What stores saturates smoothly with its state, :math:`n = 2`.

    Parameters
    ----------
    target : str
        Parameter and signal, as ``"K(u)"``.
    bend : float, default=0
        Inverse :math:`b` of the magnitude, or of its square, at which the coefficient has halved
        [1/signal, or 1/signal^2].

    Examples
    --------
    >>> from sklearn_pgnn.physics import PhysicsModel
    >>> lag = PhysicsModel({"y": "V"}, {"y": "K*u - a*y"}, {"K": 2.0, "a": 1.0}, {"u": "V"})
    >>> ParameterSaturation.targets(lag)
    ('K(u)', 'a(y)')
    >>> print((lag + ParameterSaturation("K(u)", bend=0.1)).to_text())
    y' = K*u/(bend_K_u*abs(u) + 1) - a*y
    """

    bend: float = quantity("bend", "{per_signal}")
    id = "parameter_saturation"
    summary = (
        "This parameter falls as its own signal grows (bend above 0: iron that saturates, a valve "
        "at its end) or grows with it (bend below 0: the thrust of a propeller)."
    )
    check = (
        "Apply signals of growing size: the response grows less than proportionally, or more if "
        "the bend is below 0."
    )

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return coefficients of a function of a single measured signal, with that signal."""
        pairs = (
            (name, signal)
            for name, slopes in _coefficients(model).items()
            for signal in _shown(model)
            if any(_moving(model, slope) == {signal} for slope in slopes)
        )
        positions = set(model.kinematic_pairs.values())
        coefficients = tuple(
            pair(name, signal)
            for name, signal in pairs
            if signal in model.inputs or not (is_velocity(model, signal) or signal in positions)
        )
        return (*coefficients, *(pair(*own) for own in _own_signals(model)))

    @classmethod
    def title(cls, target: str) -> str:
        """Return parameter and signal in words."""
        return "{} that changes with the size of {}".format(*parts(target))

    @classmethod
    def factor(cls, target: str, model: PhysicsModel, p: Symbols) -> sympy.Expr:
        """Return 1/(1 + b*abs(s)), or 1/(1 + b*s^2) of what stores."""
        signal, power = symbol(parts(target)[1]), cls.power(target, model)
        return 1 / (1 + p["bend"] * sympy.Abs(signal) ** power)

    @classmethod
    def power(cls, target: str, model: PhysicsModel) -> int:
        """Return 2 of what divides in the rate of its own state, whatever else acts there."""
        name, signal = parts(target)
        p, rate = symbol(name), model.equations.get(signal, sympy.Integer(0))
        divides = rate.has(p) and not sympy.expand(rate.diff(p) * p**2).has(p)
        return 2 if divides else 1

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Bound the growth of the parameter to a factor of two."""
        peak = (scales.peak[parts(target)[1]] or 1.0) ** cls.power(target, model)
        return {"bend": (-0.5 / peak, GROWN / peak)}


def _coefficients(model: PhysicsModel) -> dict[str, tuple[sympy.Expr, ...]]:
    """Return the parameters in which the rates are linear, with the derivatives by them."""
    found = {}
    for name in model.free_parameters:
        p = symbol(name)
        slopes = tuple(rate.diff(p) for rate in model.equations.values() if rate.has(p))
        if slopes and model.parameters[name].value and not any(s.has(p) for s in slopes):
            found[name] = slopes
    return found


def _any_has(expressions: Iterable[sympy.Expr], signal: str) -> bool:
    return any(expression.has(symbol(signal)) for expression in expressions)


def _others(model: PhysicsModel, linear: Collection[str]) -> Iterator[str]:
    """Yield the parameters that the rates are not linear in, or that only outputs hold."""
    used = {s for e in (*model.equations.values(), *model.outputs.values()) for s in e.free_symbols}
    for name in model.free_parameters:
        if name not in linear and symbol(name) in used and model.parameters[name].value:
            yield name


def _divided(model: PhysicsModel, name: str) -> tuple[str, ...]:
    """Return the states in whose rates a parameter stands."""
    return tuple(state for state, rate in model.equations.items() if rate.has(symbol(name)))


def _is_capacity(model: PhysicsModel, name: str) -> bool:
    """Return whether a parameter divides whole rates, and acts in no other way."""
    p, rates = symbol(name), [model.equations[state] for state in _divided(model, name)]
    divides = all(sympy.expand(rate.diff(p) * p + rate) == 0 for rate in rates)
    return bool(rates) and divides and not _any_has(model.outputs.values(), name)


def _own_signals(model: PhysicsModel) -> Iterator[tuple[str, str]]:
    """Yield what divides the whole rate of one measured store, with its state and only input."""
    stores = set(first_order_states(model)) & told_states(model)
    for name in model.free_parameters:
        of = _divided(model, name)
        if len(of) == 1 and of[0] in stores and _is_capacity(model, name):
            yield name, of[0]
            moving = _moving(model, model.equations[of[0]]) - {of[0]}
            yield from ((name, u) for u in moving & set(model.inputs) if len(moving) == 1)


def _shown(model: PhysicsModel) -> tuple[str, ...]:
    """Return the inputs, and the states measured by an output, itself or by their position."""
    told = told_states(model)
    return (*(state for state in model.states if state in told), *model.inputs)


def _drives_or_moves(model: PhysicsModel, signal: str) -> bool:
    """Return whether a signal is an input of some rate, or a velocity."""
    if signal in model.states:
        return is_velocity(model, signal)
    return any(rate.has(symbol(signal)) for rate in model.equations.values())


def _moving(model: PhysicsModel, expression: sympy.Expr) -> set[str]:
    """Return the states and inputs in an expression."""
    return set(map(str, expression.free_symbols)) & {*model.states, *model.inputs}


@dataclass(frozen=True)
class InputFading(ParameterDependence):
    r"""An input whose gain falls with the speed that it drives, :math:`u\,(1 - f|v|)`.

    So does the force of a motor on a fixed supply: the throttle's effect falls as the back-EMF
    takes up the voltage. Behind a dead zone, which is an effect of its own, this is
    :math:`k(v)\,(u - u_0)`. A drag is another law: it is there without an input, too.

    Parameters
    ----------
    target : str
        Input and speed, as ``"throttle(v)"``.
    fading : float, default=0
        Inverse :math:`f` of the speed at which the input has no effect [1/speed].

    Examples
    --------
    >>> from sklearn_pgnn.physics.systems import cart_on_spring
    >>> InputFading.targets(cart_on_spring())
    ('force(v)',)
    >>> print((cart_on_spring() + InputFading("force(v)", fading=0.1)).to_text().splitlines()[1])
    v' = (-d*v + force*(-fu_force_v*abs(v) + 1) - k*x)/m
    """

    fading: float = quantity("fu", "{per_signal}")
    id = "input_fading"
    lacking = "has a"
    summary = "The same command gives less force at speed: back-EMF, slip, a pump on its curve."
    check = "Give one command at two speeds, driven from outside, and measure the force."

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the inputs with the measured speeds whose rates they act in."""
        told = told_states(model)
        known = (v for v in model.states if v in told)
        speeds = [v for v in known if is_velocity(model, v) or may_be_speed(model, v)]
        return tuple(
            pair(u, v) for u in model.inputs for v in speeds if model.equations[v].has(symbol(u))
        )

    @classmethod
    def can_act(cls, target: str, model: PhysicsModel) -> bool:
        """Return whether the model has the input and the speed."""
        u, v = parts(target)
        return u in model.inputs and v in model.states

    @classmethod
    def title(cls, target: str) -> str:
        """Return input and speed in words."""
        return "gain of {} that falls with {}".format(*parts(target))

    @classmethod
    def factor(cls, target: str, model: PhysicsModel, p: Symbols) -> sympy.Expr:
        """Return 1 - f*abs(v)."""
        return 1 - p["fading"] * sympy.Abs(symbol(parts(target)[1]))

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Keep the input's sign over the range of the speed."""
        peak = scales.peak[parts(target)[1]] or 1.0
        return {"fading": (-GROWN / peak, (1 - KEPT) / peak)}

    def characteristic(self, model: PhysicsModel) -> Characteristic | None:
        """Return no curve: the force depends on the input and the speed."""
        return None
