"""A drive whose force falls as the machine gets faster."""

from dataclasses import dataclass

import sympy

from sklearn_pgnn.physics.characteristic import Characteristic
from sklearn_pgnn.physics.effect import Symbols, quantity
from sklearn_pgnn.physics.effects.dependences import GROWN, KEPT, ParameterDependence
from sklearn_pgnn.physics.effects.rates import is_velocity, may_be_speed
from sklearn_pgnn.physics.effects.targets import pair, parts
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.scales import Scales
from sklearn_pgnn.physics.shown_states import told_states


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
