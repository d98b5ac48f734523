"""Effects on an output: the reading of the sensor differs from the true value."""

from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import sympy

from sklearn_pgnn.physics.characteristic import Characteristic
from sklearn_pgnn.physics.effect import Effect, Symbols, quantity
from sklearn_pgnn.physics.effects.inputs import Delay, Lag
from sklearn_pgnn.physics.effects.targets import free_name
from sklearn_pgnn.physics.expressions import TIME, maximum, minimum, symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.repeated_rates import with_output
from sklearn_pgnn.physics.scales import Scales
from sklearn_pgnn.physics.units import plain_unit

#: placeholder for the angle that an output measures
ANGLE = sympy.Symbol("_angle", real=True)
#: a turn in the units of angles
TURNS = {"rad": 2 * sympy.pi, "deg": sympy.Integer(360), "rev": sympy.Integer(1)}
TURNS |= {"turn": TURNS["rev"], "revolution": TURNS["rev"], "mrad": 2000 * sympy.pi}
#: largest factor by which a curved scale is steeper, or flatter, than at zero
STEEPEST = 10.0


@dataclass(frozen=True)
class OutputEffect(Effect):
    """An output that is replaced by an expression of it."""

    phrase = "{effect} of {target}"

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the names of the outputs of the model."""
        return tuple(model.outputs)

    def shown(self, y: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return the reading of the sensor for the true output."""
        raise NotImplementedError

    def rewrite(self, model: PhysicsModel, p: Symbols) -> dict:
        """Replace the output."""
        return with_output(model, self.target, lambda true: self.shown(true, p))

    def characteristic(self, model: PhysicsModel) -> Characteristic | None:
        """Return the error of the sensor over the true output."""
        return Characteristic("output", self.target)


@dataclass(frozen=True)
class SensorBias(OutputEffect):
    r"""A sensor with a constant offset, :math:`y + b`.

    Parameters
    ----------
    target : str
        The output.
    bias : float, default=0
        Bias :math:`b` [output].

    Examples
    --------
    >>> SensorBias("phi", bias=0.01).names()
    {'bias': 'by_phi'}
    """

    bias: float = quantity("by", "{target}")
    id = "sensor_bias"
    fault = "bias"
    summary = "The reading has a constant offset: the zero is set incorrectly."
    check = "Bring the machine to a known position and read the sensor."

    def shown(self, y: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return y + b."""
        return y + p["bias"]


@dataclass(frozen=True)
class SensorGain(OutputEffect):
    r"""A sensor with a gain error, :math:`(1 + g)\,y`.

    Parameters
    ----------
    target : str
        The output.
    error : float, default=0
        Relative error :math:`g` of the gain [-].

    Examples
    --------
    >>> SensorGain("phi", error=0.05).names()
    {'error': 'gy_phi'}
    """

    error: float = quantity("gy", "", low=-0.95)
    id = "sensor_gain"
    fault = "gain"
    summary = "The sensor's scale is off: counts per turn, amplifier gain, lever length."
    check = "Move between two known positions and compare the reading's difference."

    def shown(self, y: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return (1 + g)*y."""
        return (1 + p["error"]) * y


@dataclass(frozen=True)
class SensorCurvature(OutputEffect):
    r"""A sensor with a curved scale, :math:`y + c\,y^2`.

    The slope of the scale is one at zero, and :math:`\sqrt{1 + 4 c r}` at the reading :math:`r`: a
    fit keeps it between a tenth and ten over all readings.

    Parameters
    ----------
    target : str
        The output.
    curvature : float, default=0
        Curvature :math:`c` [1/output].

    Examples
    --------
    >>> SensorCurvature("level", curvature=0.02).names()
    {'curvature': 'cy_level'}
    """

    curvature: float = quantity("cy", "{per_target}")
    id = "sensor_curvature"
    fault = "curvature"
    summary = (
        "The sensor's characteristic is curved: a float on an arm, a thermistor, a worn "
        "potentiometer."
    )
    check = "Move through several known positions and plot the reading over them."

    def shown(self, y: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return y + c*y^2."""
        return y + p["curvature"] * y**2

    def units(self, model: PhysicsModel) -> dict[str, str]:
        """Return one over the output's unit."""
        unit = model.unit(self.target)
        return {"per_target": f"1/({unit})" if unit else ""}

    @classmethod
    def typical(cls, target: str, model: PhysicsModel, scales: Scales) -> dict[str, float]:
        """Return one over the output's largest magnitude."""
        return {"per_target": 1.0 / max(scales.peak[target], 1e-300)}

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Keep the slope of the scale within its range at both ends of the readings."""
        slopes = np.array([1 / STEEPEST, STEEPEST])
        ends = [np.sort((slopes**2 - 1) / (4 * end)) for end in scales.ends(target) if end]
        if not ends:
            return {}
        return {"curvature": (float(max(e[0] for e in ends)), float(min(e[1] for e in ends)))}


@dataclass(frozen=True)
class SensorEccentricity(OutputEffect):
    r"""A sensor of an angle that is mounted off centre, :math:`y + a\sin q + b\cos q`.

    The error has one cycle a turn of the angle :math:`q`: the one angle that the output depends on,
    or the output itself where that is an angle made of several. The output may be in another unit,
    such as counts or volts.

    Parameters
    ----------
    target : str
        The output.
    sine, cosine : float, default=0
        Amplitudes :math:`a, b` [output].

    Examples
    --------
    >>> from sklearn_pgnn.physics.systems import golf_robot
    >>> (golf_robot() + SensorEccentricity("phi_measured", sine=0.01)).outputs["phi_measured"]
    ec_phi_measured*cos(phi) + es_phi_measured*sin(phi) + phi
    """

    sine: float = quantity("es", "{target}")
    cosine: float = quantity("ec", "{target}")
    id = "sensor_eccentricity"
    fault = "eccentricity"
    phrase = "off-centre mounting of {target}"
    lacking = "lacks the"
    summary = "The error of the angle repeats with every turn: an encoder or a dial off centre."
    check = "Turn the sensor on its shaft by half a turn: the error at an angle changes its sign."

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the names of the outputs that measure an angle."""
        return tuple(name for name in model.outputs if _angle(model, name) is not None)

    def shown(self, y: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return y with one cycle a turn."""
        return y + p["sine"] * sympy.sin(ANGLE) + p["cosine"] * sympy.cos(ANGLE)

    def rewrite(self, model: PhysicsModel, p: Symbols) -> dict:
        """Replace the output, with the angle in the place of its symbol."""
        at = {ANGLE: _angle(model, self.target)}
        return with_output(model, self.target, lambda true: self.shown(true, p).xreplace(at))


def _angle(model: PhysicsModel, output: str) -> sympy.Expr | None:
    """Return the angle [rad] that an output measures, if it measures one.

    >>> from sklearn_pgnn.physics import PhysicsModel
    >>> outputs = {"counts": "1000*q", "dial": "p", "speed": "w", "both": "p + r", "to": "q - p"}
    >>> states = {"q": "rad", "w": "rad/s", "p": "deg", "r": "deg"}
    >>> arm = PhysicsModel(states, {"q": "w", "w": "-q", "p": "r", "r": "p"}, outputs=outputs)
    >>> [_angle(arm, output) for output in outputs]
    [q, pi*p/180, None, pi*(p + r)/180, None]
    """
    shown = model.outputs[output]
    turns = {s: TURNS.get(plain_unit(unit)) for s, unit in model.states.items()}
    angles = [s for s, turn in turns.items() if turn and shown.has(symbol(s))]
    if len(angles) == 1:
        return 2 * sympy.pi * symbol(angles[0]) / turns[angles[0]]
    turn = TURNS.get(plain_unit(model.unit(output)))
    return 2 * sympy.pi * shown / turn if angles and turn else None


@dataclass(frozen=True)
class SensorSaturation(OutputEffect):
    r"""A sensor that saturates, :math:`\max(\min(y, y_+), y_-)`.

    Parameters
    ----------
    target : str
        The output.
    upper, lower : float, default=1e9, -1e9
        Ends of its range :math:`y_+, y_-` [output].

    Examples
    --------
    >>> SensorSaturation("level", upper=10.0).names()
    {'upper': 'yu_level', 'lower': 'yl_level'}
    """

    upper: float = quantity("yu", "{target}", default=1e9, role="end")
    lower: float = quantity("yl", "{target}", default=-1e9, role="end")
    id = "sensor_saturation"
    fault = "range"
    summary = "The signal exceeds the sensor's range: the reading is clipped."
    check = "Look for stretches in which the reading stays at one extreme value."

    def shown(self, y: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return y within the range."""
        return maximum(minimum(y, p["upper"]), p["lower"])

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple[Effect, ...]:
        """Start with an upper end, a lower end, or both."""
        cuts = ((0.02, 0.0), (0.0, 0.02), (0.02, 0.02), (0.1, 0.0), (0.0, 0.1), (0.15, 0.15))
        places = (scales.ends(target, below, above) for above, below in cuts)
        return tuple(cls(target, upper, lower) for lower, upper in places)

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Keep the ends within the range of the readings."""
        (low, high), (lowest, highest) = scales.ends(target), scales.ends(target, 0.02, 0.02)
        return {"upper": (lowest, high), "lower": (low, highest)}


@dataclass(frozen=True)
class SensorRectification(OutputEffect):
    r"""A sensor that measures the magnitude only, :math:`|y|`.

    Parameters
    ----------
    target : str
        The output.

    Examples
    --------
    >>> from sklearn_pgnn.physics import PhysicsModel
    >>> lag = PhysicsModel({"v": "m/s"}, {"v": "(u - v)/T"}, {"T": 2.0}, {"u": "V"})
    >>> print((lag + SensorRectification("v")).to_text())
    v' = (u - v)/T
    """

    id = "sensor_rectification"
    fault = "magnitude"
    summary = "The sensor shows the magnitude without the sign: a pulse counter, a rectifier."
    check = "Run the machine backward: the reading does not change its sign."

    def shown(self, y: sympy.Expr, p: Symbols) -> sympy.Expr:
        """Return abs(y)."""
        return sympy.Abs(y)


@dataclass(frozen=True)
class SensorLag(Lag):
    r"""A sensor that follows what it measures with a first-order lag.

    .. math:: T\,\dot y_s = y - y_s

    Parameters
    ----------
    target : str
        The output.
    time_constant : float, default=1
        Time constant :math:`T` [s].

    Examples
    --------
    >>> from sklearn_pgnn.physics import PhysicsModel
    >>> oven = PhysicsModel({"T": "K"}, {"T": "P/C"}, {"C": 80.0}, {"P": "W"}, {"probe": "T"})
    >>> print((oven + SensorLag("probe", time_constant=5.0)).to_text())
    T' = P/C
    probe_lagged' = (T - probe_lagged)/Ty_probe
    """

    time_constant: float = quantity("Ty", "s", default=1.0, low=1e-9)
    id = "sensor_lag"
    fault = "lag"
    phrase = "{effect} of {target}"
    summary = "The reading follows late: a thermometer in its pocket, a filter, a long tube."
    check = "Bring the sensor alone from one known value to another, and record its reading."

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the outputs of states alone that are no sensor's own."""
        own = {symbol(name) for name in (*model.inputs, *model.settled)}
        states = {symbol(name) for name in model.states}
        seen = {y: shown.free_symbols for y, shown in model.outputs.items()}
        return tuple(y for y, symbols in seen.items() if symbols & states and not symbols & own)

    def rewrite(self, model: PhysicsModel, p: Symbols) -> dict:
        """Add the sensor's state, and show it."""
        true, lagged = model.outputs[self.target], free_name(model, f"{self.target}_lagged")
        rate = (true - symbol(lagged)) / p["time_constant"]
        return {
            "outputs": {**model.outputs, self.target: symbol(lagged)},
            "equations": {**model.equations, lagged: rate},
            "states": {**model.states, lagged: model.unit(self.target)},
            **_begun(model, true, lagged),
        }

    def characteristic(self, model: PhysicsModel) -> Characteristic | None:
        """Return the output over the time."""
        return Characteristic("output", self.target, TIME)


def _begun(model: PhysicsModel, true: sympy.Expr, lagged: str) -> dict:
    """Return where a sensor's state begins: at what it measures."""
    if str(true) in model.states:
        return {"settled": {**model.settled, lagged: str(true)}}
    known = {name: p.value for name, p in model.parameters.items()} | dict(model.initial_state)
    value = true.subs({s: known.get(str(s), 0.0) for s in true.free_symbols})
    start = float(value) if value.is_finite and value.is_real else 0.0
    return {"initial_state": {**model.initial_state, lagged: start}}


@dataclass(frozen=True)
class SensorDelay(Delay):
    r"""A sensor with a delay, :math:`y(t - \tau)`.

    For the only sensor of a machine this is a delay of all inputs: the states of the extended
    model are those that the sensor shows at the time, :math:`x(t - \tau)`.

    Parameters
    ----------
    target : str
        The output.
    delay : float, default=0
        Delay :math:`\tau` [s].

    Examples
    --------
    >>> SensorDelay("y", delay=0.02).names()
    {'delay': 'tau_y'}
    """

    id = "sensor_delay"
    excludes = ("input_delay",)
    resembles = MappingProxyType({"sensor_lag": ("delay", "time_constant")})
    summary = "The reading is delayed: filtering, bus, transport from the machine to the probe."
    check = (
        "Excite the machine with an impulse and compare the reading with a second, direct sensor."
    )

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the output of a model with a single output, whose inputs have no delay."""
        late = model.delays or not model.inputs or len(model.outputs) > 1
        return () if late else tuple(model.outputs)

    def rewrite(self, model: PhysicsModel, p: Symbols) -> dict:
        """Delay every input."""
        return {"delays": {name: str(p["delay"]) for name in model.inputs}}

    def characteristic(self, model: PhysicsModel) -> Characteristic | None:
        """Return the output over the time."""
        return Characteristic("output", self.target, TIME)
