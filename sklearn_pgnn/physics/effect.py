"""An effect: a named rewriting of a model."""

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import Field, dataclass, field, fields
from types import MappingProxyType
from typing import Any, ClassVar

import sympy

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.characteristic import Characteristic
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.model_units import tidy_unit
from sklearn_pgnn.physics.parameter import Parameter
from sklearn_pgnn.physics.port import PortName
from sklearn_pgnn.physics.scales import Scales, typical_by_kind, typical_value
from sklearn_pgnn.readings import reading

__all__ = ["Characteristic", "Effect", "Scales", "quantity"]

#: roles of a quantity of an effect, see `quantity`
ROLES = ("size", "shape", "end")
#: the parameters of an effect in its equations, by field name
Symbols = Mapping[str, sympy.Symbol]
#: if an effect has several strengths, the first counts in full and the others by this fraction
BESIDE = 0.5


def quantity(
    letter: str,
    unit: str,
    default: float = 0.0,
    low: float = -math.inf,
    high: float = math.inf,
    role: str = "size",
) -> Any:
    """Declare a physical parameter of an effect as a dataclass field.

    Parameters
    ----------
    letter : str
        Symbol in the equations, put before the target's name.
    unit : str
        Unit, as a template over the units that `Effect.units` returns, e.g.
        ``"{force}/({velocity})"``.
    default : float, default=0.0
        Value at which the effect does nothing, or the usual value.
    low, high : float
        Bounds.
    role : {"size", "shape", "end"}, default="size"
        Whether the parameter describes how strongly the effect acts (size), over what or how
        sharply (shape: a period, a time constant, the stiffness of a stop), or where something
        ends, so that a large value does nothing (end: a limit).

    Returns
    -------
    dataclasses.Field
        The field.
    """
    if role not in ROLES:
        raise ValueError(f"role: expected one of {', '.join(ROLES)}, got {role!r}.")
    about = {"letter": letter, "unit": unit, "low": low, "high": high, "role": role}
    return field(default=default, metadata=about)


@dataclass(frozen=True)
class Effect(ABC):
    """A named rewriting of a model; ``model + effect`` is again a model.

    An effect is self-contained: it holds its equations, its name in plain words, the start values
    and limits of a fit, its strength, and the curve that shows it. To write your own, define a
    frozen dataclass with an ``id``, a `quantity` for every physical parameter, and the methods
    `targets`, `rewrite` and `starts`; where the defaults do not suffice, also `limits`,
    `characteristic`, `phrase`, `units` and `typical`. The start values of states that it adds are
    set by its `rewrite`, through ``initial_state`` or, for a state that follows an input,
    ``settled``.

    Parameters
    ----------
    target : str
        The port, state, input, output or parameter the effect acts on; a pair such as ``"k(x)"``
        if one depends on the other.

    Examples
    --------
    >>> from sklearn_pgnn import effects, systems
    >>> friction = effects.CoulombFriction("v", level=1.0)
    >>> isinstance(friction, Effect)
    True
    >>> print((systems.cart_on_spring() + friction).equations["v"])
    (-Fc_v*sign(v) - d*v + force - k*x)/m
    """

    target: str
    #: the effect's name in a diagnosis
    id: ClassVar[str]
    #: its name in plain words: ``{effect}`` is the words of its id, ``{target}`` its target
    phrase: ClassVar[str] = "{effect} on {target}"
    #: verb for a model that lacks the effect: the words before the phrase
    lacking: ClassVar[str] = "lacks"
    #: what a parameter is called where its name alone would be misread
    words: ClassVar[Mapping[str, str]] = MappingProxyType({})
    #: one sentence for the reader of a report: what the effect is
    summary: ClassVar[str] = ""
    #: one sentence for the reader of a report: how to check the effect on the rig
    check: ClassVar[str] = ""
    #: which fault of an actuator or a sensor it is, see `channel_kinds`; empty for one of the plant
    fault: ClassVar[str] = ""
    #: summary and check where the input that it acts on is measured
    of_reading: ClassVar[tuple[str, ...]] = ()
    #: ids of effects that are a special case of this one
    generalises: ClassVar[tuple[str, ...]] = ()
    #: ids of effects that cannot be combined with this one
    excludes: ClassVar[tuple[str, ...]] = ()
    #: whether the parameter that it acts on may have any other value as well
    revalues: ClassVar[bool] = False
    #: by id of an effect on the same target, the fields that the other effect takes over and
    #: that stay at zero here
    shared: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType({})
    #: by id of an effect that looks like this one below its own limits: the field of this
    #: effect, and the field of the other that it corresponds to
    resembles: ClassVar[Mapping[str, tuple[str, str]]] = MappingProxyType({})

    @classmethod
    @abstractmethod
    def targets(cls, model: PhysicsModel) -> tuple[str, ...]:
        """Return the names of the quantities of a model that the effect can act on.

        Parameters
        ----------
        model : PhysicsModel
            The model.

        Returns
        -------
        tuple of str
            Possible targets.
        """

    @abstractmethod
    def rewrite(self, model: PhysicsModel, p: Mapping[str, sympy.Symbol]) -> dict:
        """Return the parts of the model that the effect changes.

        Parameters
        ----------
        model : PhysicsModel
            The model to extend.
        p : mapping of str to sympy.Symbol
            The effect's own parameters as symbols, by field name.

        Returns
        -------
        dict
            Constructor parameters of `PhysicsModel` and their new values; `apply` adds the
            effect's own parameters.
        """

    @classmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple["Effect", ...]:
        """Return the start values for a fit of the effect.

        Parameters
        ----------
        target : str
            One of `targets`.
        model : PhysicsModel
            The model to extend.
        scales : Scales
            Magnitudes of the signals.

        Returns
        -------
        tuple of Effect
            Start values, the most likely first; by default the values at which it does nothing.
        """
        return (cls(target),)

    def proposals(self, model: PhysicsModel, scales: Scales) -> tuple["Effect", ...]:
        """Propose start values for a fit of this effect on its target; see `starts`.

        Parameters
        ----------
        model : PhysicsModel
            The model to extend.
        scales : Scales
            Magnitudes of the signals.

        Returns
        -------
        tuple of Effect
            Start values, the most likely first.
        """
        return self.starts(self.target, model, scales)

    def is_distinct(self, scales: Scales) -> bool:
        """Return whether signals of this range distinguish the effect from its special cases.

        Parameters
        ----------
        scales : Scales
            Magnitudes of the signals.

        Returns
        -------
        bool
            True by default; if False, the special cases suffice.
        """
        return True

    def is_shown(self, model: PhysicsModel, scales: Scales) -> bool:
        """Return whether signals of this range can show the effect at all.

        Parameters
        ----------
        model : PhysicsModel
            The model to extend.
        scales : Scales
            Magnitudes of the signals.

        Returns
        -------
        bool
            True by default; if False, a diagnosis does not try it.
        """
        return True

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Return sensible limits for a fit of the effect's parameters.

        Parameters
        ----------
        target : str
            One of `targets`.
        model : PhysicsModel
            The model to extend.
        scales : Scales
            Magnitudes of the signals.

        Returns
        -------
        dict of str to tuple of float
            Lowest and highest value by field name, narrower than the quantity's own bounds.
        """
        return {}

    def characteristic(self, model: PhysicsModel) -> Characteristic | None:
        """Return the curve that shows the effect.

        Parameters
        ----------
        model : PhysicsModel
            The extended model.

        Returns
        -------
        Characteristic or None
            The curve; None if the errors with and without the effect are more informative.
        """
        return None

    @classmethod
    def title(cls, target: str) -> str:
        """Return the name of the effect on a target in plain words.

        Parameters
        ----------
        target : str
            What it acts on.

        Returns
        -------
        str
            The `phrase`, filled in.

        Examples
        --------
        >>> from sklearn_pgnn.physics.effects import CoulombFriction, InputBias
        >>> CoulombFriction.title("omega"), InputBias.title("torque")
        ('Coulomb friction on omega', 'input bias of torque')
        """
        named = isinstance(target, PortName)
        phrase = re.sub(r" (on|at) (?={target})", " at the ", cls.phrase) if named else cls.phrase
        return phrase.format(effect=cls.id.replace("_", " "), target=target)

    def summarise(self, model: PhysicsModel) -> str:
        """Return a sentence with the fitted values, where that says more than `summary`.

        Parameters
        ----------
        model : PhysicsModel
            The extended model.

        Returns
        -------
        str
            The sentence; empty by default.
        """
        return ""

    @classmethod
    def size_field(cls) -> str:
        """Return the field for the strength of the effect: the first that is not a shape.

        Returns
        -------
        str
            The field; empty for an effect that is either present or absent.
        """
        sizes = (f.name for f in cls.quantities() if f.metadata["role"] != "shape")
        return next(sizes, "")

    @classmethod
    def nothing(cls, target: str, model: PhysicsModel, scales: Scales) -> float:
        """Return the value of `size_field` at which the effect does nothing.

        Parameters
        ----------
        target : str
            One of `targets`.
        model : PhysicsModel
            The model to extend.
        scales : Scales
            Magnitudes of the signals.

        Returns
        -------
        float
            The value.
        """
        name = cls.size_field()
        ends = [f.name for f in cls.quantities() if f.metadata["role"] == "end"]
        return cls.limits(target, model, scales)[name][1] if name in ends else 0.0

    @classmethod
    def of_size(
        cls, target: str, model: PhysicsModel, scales: Scales
    ) -> "Callable[[float], Effect]":
        """Return the effect as a function of its size.

        Size 0 does nothing. Size 1 is a force as large as the typical inertial force, a bias or a
        dead zone as large as the signal's variation, a limit that lets nothing through, a delay
        as long as a window. Shapes take the middle one of the start values of a fit.

        Parameters
        ----------
        target : str
            One of `targets`.
        model : PhysicsModel
            The model to extend.
        scales : Scales
            Magnitudes of the signals.

        Returns
        -------
        callable
            The effect of a size between 0 and 1.

        Examples
        --------
        >>> from sklearn_pgnn.physics.effects import InputSaturation
        >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
        >>> scales = Scales({"u": 1.0, "y": 1.0}, {"u": 2.0, "y": 2.0}, {"y": 1.0}, 0.01, 1.0)
        >>> InputSaturation.of_size("u", lag, scales)(0.25)
        InputSaturation(target='u', limit=1.5)
        """
        starts, limits = cls.starts(target, model, scales), cls.limits(target, model, scales)
        usual, first = starts[len(starts) // 2], cls.size_field()
        typical = cls.typical(target, model, scales)

        def value(quantity: Field, size: float) -> float:
            about, name = quantity.metadata, quantity.name
            if about["role"] == "shape":
                return getattr(usual, name)
            if about["role"] == "end":
                wanted = _end(quantity, getattr(usual, name), limits[name], size)
            else:
                share = 1.0 if name == first else BESIDE
                wanted = share * size * typical_value(about["unit"], typical)
            low, high = limits.get(name, (about["low"], about["high"]))
            return float(min(max(wanted, about["low"], low), about["high"], high))

        return lambda size: cls(target, **{f.name: value(f, size) for f in cls.quantities()})

    @classmethod
    def typical(cls, target: str, model: PhysicsModel, scales: Scales) -> dict[str, float]:
        """Return a typical value of every kind of unit that the parameters' templates refer to.

        Parameters
        ----------
        target : str
            One of `targets`.
        model : PhysicsModel
            The model to extend.
        scales : Scales
            Magnitudes of the signals.

        Returns
        -------
        dict of str to float
            Value by kind, as `units` names them.
        """
        return typical_by_kind(target, model, scales)

    @classmethod
    def can_act(cls, target: str, model: PhysicsModel) -> bool:
        """Return whether a model can be extended by the effect on a target.

        Parameters
        ----------
        target : str
            What it acts on.
        model : PhysicsModel
            The model, which may hold other effects.

        Returns
        -------
        bool
            Whether the target is one of `targets`; an effect may also act on targets that a
            diagnosis does not search.
        """
        return target in cls.targets(model)

    @classmethod
    def quantities(cls) -> tuple:
        """Return the fields that are physical parameters."""
        return tuple(f for f in fields(cls) if "letter" in f.metadata)

    def names(self) -> dict[str, str]:
        """Return the model's name of every physical parameter, by field name."""
        of = re.sub(r"\W+", "_", self.target).strip("_")
        return {f.name: f"{f.metadata['letter']}_{of}" for f in self.quantities()}

    def units(self, model: PhysicsModel) -> dict[str, str]:
        """Return the units that the parameters' unit templates refer to.

        Parameters
        ----------
        model : PhysicsModel
            The model.

        Returns
        -------
        dict of str to str
            Unit by kind.
        """
        return {"target": model.unit(self.target)}

    def parameters(self, model: PhysicsModel) -> tuple[Parameter, ...]:
        """Return the effect's physical parameters as the extended model holds them.

        Parameters
        ----------
        model : PhysicsModel
            The model to extend.

        Returns
        -------
        tuple of Parameter
            One per `quantity`.
        """
        units, names = self.units(model), self.names()
        return tuple(
            Parameter(
                names[f.name],
                getattr(self, f.name),
                unit=tidy_unit(f.metadata["unit"].format(**units)),
                bounds=(f.metadata["low"], f.metadata["high"]),
            )
            for f in self.quantities()
        )

    def apply(self, model: PhysicsModel) -> PhysicsModel:
        """Extend a model by the effect.

        Parameters
        ----------
        model : PhysicsModel
            The model; it is not changed.

        Returns
        -------
        PhysicsModel
            The extended model.

        Raises
        ------
        ModelError
            If the model has no such target or has the effect already.
        """
        if not self.can_act(self.target, model):
            possible = self.targets(model)
            raise ModelError(
                f"{self.id}: expected a target among {', '.join(possible) or 'none in this model'},"
                f" got {self.target!r}."
            )
        new = {parameter.name: parameter for parameter in self.parameters(model)}
        taken = [name for name in new if name in model.parameters]
        if taken:
            raise ModelError(f"{self.id}: the model already has a parameter {taken[0]!r}.")
        symbols = {key: symbol(name) for key, name in self.names().items()}
        changes = {"ports": model.kept_ports, **self.rewrite(model, symbols)}
        parameters = {**changes.pop("parameters", model.parameters), **new}
        return model.replace(parameters=parameters, **changes)

    def _repr_html_(self) -> str:
        return reading("effect_html")(self)

    def _repr_latex_(self) -> str | None:
        return reading("effect_latex")(self)


def _end(quantity: Any, usual: float, limits: tuple[float, float], size: float) -> float:
    """Return an end: proportional for a range; for a rate, the usual one at half the size."""
    if "/s" in quantity.metadata["unit"] or "rate" in quantity.metadata["unit"]:
        return usual * (1.0 - size) / max(size, 1e-9)
    return (1.0 - size) * (limits[1] if quantity.default > 0 else limits[0])
