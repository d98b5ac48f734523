"""Effects on a parameter: the structure is right, but a number is wrong."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from sklearn_pgnn.physics.characteristic import Characteristic
from sklearn_pgnn.physics.effect import Effect, Symbols, quantity
from sklearn_pgnn.physics.effects.inputs import substitute
from sklearn_pgnn.physics.expressions import TIME, symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.parameter import Parameter
from sklearn_pgnn.physics.scales import Scales


@dataclass(frozen=True)
class WrongParameter(Effect):
    """A parameter whose value lies outside its spread: re-tuning may go as far as its bounds.

    Parameters
    ----------
    target : str
        The parameter.
    value : float, optional
        Its true value, if known; by default the value is unchanged and only freed.

    Examples
    --------
    >>> from sklearn_pgnn.physics import PhysicsModel
    >>> lag = PhysicsModel({"y": "V"}, {"y": "-y/T"}, {"T": 2.0})
    >>> (lag + WrongParameter("T", value=3.0)).parameters["T"].value
    3.0
    """

    value: float | None = None
    id = "wrong_parameter"
    revalues = True
    phrase = "wrong value of {target}"
    lacking = "has a"
    summary = "The model has the right form, but this parameter has a wrong value."
    check = "Measure the quantity on its own, or look up how its value was found."

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the names of the parameters that are not fixed."""
        return model.free_parameters

    def names(self) -> dict[str, str]:
        """Return the parameter's own name."""
        return {"value": self.target}

    def parameters(self, model: PhysicsModel) -> tuple[Parameter, ...]:
        """Return no new parameters: the parameter is the model's own."""
        return ()

    def rewrite(self, model: PhysicsModel, p: Symbols) -> dict:
        """Free the parameter within its bounds."""
        parameter = model.parameters[self.target]
        if self.value is not None:
            parameter = parameter.with_value(self.value)
        return {
            "parameters": {
                **model.parameters,
                self.target: replace(parameter, spread=math.inf),
            }
        }

    def characteristic(self, model: PhysicsModel) -> Characteristic | None:
        """Return the missing rate over the contribution of the new value to it."""
        return Characteristic("parameter", self.target)

    @classmethod
    def size_field(cls) -> str:
        """Return the value."""
        return "value"

    @classmethod
    def nothing(cls, target: str, model: PhysicsModel, scales: Scales) -> float:
        """Return the prior value."""
        return model.parameters[target].value

    @classmethod
    def of_size(cls, target: str, model: PhysicsModel, scales: Scales) -> Callable[[float], Effect]:
        """Return the value as a function of the size: at size 1 twice the prior's, 1 where it is 0.

        It stays within the parameter's bounds.
        """
        parameter = model.parameters[target]
        (low, high), change = parameter.bounds, parameter.value or 1.0
        return lambda size: cls(target, value=min(max(parameter.value + size * change, low), high))


@dataclass(frozen=True)
class ParameterDrift(Effect):
    r"""A parameter that changes during a record, :math:`p\,(1 + r\,t)`.

    Parameters
    ----------
    target : str
        The parameter.
    rate : float, default=0
        Relative change :math:`r` [1/s], over the time of the record.

    Examples
    --------
    >>> from sklearn_pgnn.physics import PhysicsModel
    >>> lag = PhysicsModel({"y": "V"}, {"y": "-y/T"}, {"T": 2.0})
    >>> print((lag + ParameterDrift("T", rate=0.01)).to_text())
    y' = -y/(T*(drift_T*t + 1))
    """

    rate: float = quantity("drift", "1/s")
    id = "parameter_drift"
    summary = "This parameter changes during the record: warming up, wear, a tank that empties."
    check = "Identify it from the first and from the last part of a long record."

    @classmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the names of the parameters that are not fixed."""
        return model.free_parameters

    def rewrite(self, model: PhysicsModel, p: Symbols) -> dict:
        """Replace the parameter by its changing value."""
        parameter = symbol(self.target)
        return substitute(model, parameter, parameter * (1 + p["rate"] * TIME))

    def characteristic(self, model: PhysicsModel) -> Characteristic | None:
        """Return the parameter over the time."""
        law = symbol(self.target) * (1 + symbol(self.names()["rate"]) * TIME)
        return Characteristic("parameter", self.target, TIME, law=law)

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Keep the parameter's sign to the end of the records."""
        return {"rate": (-0.95 / scales.latest, 20.0 / scales.latest)}
