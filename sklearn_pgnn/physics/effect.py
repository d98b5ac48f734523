"""An effect: a rewriting of a model that has a name."""

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from types import MappingProxyType
from typing import ClassVar

import sympy

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.characteristic import Characteristic
from sklearn_pgnn.physics.derived_units import tidy_unit
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.parameter import Parameter
from sklearn_pgnn.physics.scales import Scales
from sklearn_pgnn.physics.typical import typical_by_kind, typical_value
from sklearn_pgnn.readings import reading

__all__ = ["Characteristic", "Effect", "Scales", "quantity"]

#: what a quantity of an effect may be, see `quantity`
ROLES = ("size", "shape", "end")
#: of several strengths the first is taken whole and the others in this share
BESIDE = 0.5


def quantity(letter, unit, default=0.0, low=-math.inf, high=math.inf, role="size"):
    """Declare a physical parameter of an effect as a dataclass field.

    Parameters
    ----------
    letter : str
        Symbol it gets in the equations, before the target's name.
    unit : str
        What it measures: a template over the units that `Effect.units` returns, e.g.
        ``"{force}/({velocity})"``.
    default : float, default=0.0
        Value at which the effect does nothing, or its usual one.
    low, high : float
        Bounds.
    role : {"size", "shape", "end"}, default="size"
        Whether it is how strongly the effect acts, over what or how sharply (a period, a time
        constant, the stiffness of a stop), or where something ends, so that a large value does
        nothing (a limit).

    Returns
    -------
    dataclasses.Field
        The field.

    Raises
    ------
    ValueError
        If the role is none of these.
    """
    if role not in ROLES:
        raise ValueError(f"role: expected one of {', '.join(ROLES)}, got {role!r}.")
    about = {"letter": letter, "unit": unit, "low": low, "high": high, "role": role}
    return field(default=default, metadata=about)


@dataclass(frozen=True)
class Effect(ABC):
    """A named rewriting of a model; ``model + effect`` is again a model.

    An effect brings all that is to be known of it: its equations, what people call it, where a fit
    starts and ends, how strong it is, and the curve that shows it. To write your own: a frozen
    dataclass with an ``id``, a `quantity` for every physical parameter, and the methods `targets`,
    `rewrite` and `starts`; where they say too little, also `limits`, `characteristic`, `phrase`,
    `units` and `typical`. States that it adds start where its `rewrite` says, by ``initial_state``
    or, behind an input, by ``settled``.

    Parameters
    ----------
    target : str
        The state, input, output or parameter the effect acts on; two of them, as in ``"k(x)"``,
        where one depends on the other.

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
    #: what people call it: ``{effect}`` stands for the words of its id, ``{target}`` for its target
    phrase: ClassVar[str] = "{effect} on {target}"
    #: what a model does that lacks it: the words before the phrase
    lacking: ClassVar[str] = "misses"
    #: one sentence a person reads: what it is
    summary: ClassVar[str] = ""
    #: one sentence a person reads: how to check it on the rig
    check: ClassVar[str] = ""
    #: ids of effects that are a special case of this one
    generalises: ClassVar[tuple[str, ...]] = ()
    #: ids of effects that cannot stand beside this one
    excludes: ClassVar[tuple[str, ...]] = ()
    #: by id of an effect that stands beside this one on the same target, the fields that it
    #: takes over and that stay at zero here
    shared: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType({})
    #: by id of an effect that looks like this one where it is below its own limits: the field of
    #: this one, and the field of the other that it stands for
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
        """Return what the effect changes.

        Parameters
        ----------
        model : PhysicsModel
            The model to extend.
        p : mapping of str to sympy.Symbol
            The effect's own parameters as symbols, by field name.

        Returns
        -------
        dict
            Constructor parameters of `PhysicsModel` and their new values; the effect's
            parameters are added by `apply`.
        """

    @classmethod
    @abstractmethod
    def starts(cls, target: str, model: PhysicsModel, scales: Scales) -> tuple["Effect", ...]:
        """Return where a fit of the effect may start.

        Parameters
        ----------
        target : str
            One of `targets`.
        model : PhysicsModel
            The model to extend.
        scales : Scales
            How large the signals are.

        Returns
        -------
        tuple of Effect
            Starts, the most likely first.
        """

    def proposals(self, model: PhysicsModel, scales: Scales) -> tuple["Effect", ...]:
        """Propose where a fit of this effect on its target may start; see `starts`.

        Parameters
        ----------
        model : PhysicsModel
            The model to extend.
        scales : Scales
            How large the signals are.

        Returns
        -------
        tuple of Effect
            Starts, the most likely first.
        """
        return self.starts(self.target, model, scales)

    def is_distinct(self, scales: Scales) -> bool:
        """Return whether signals of this range can tell the effect from those it generalises.

        Parameters
        ----------
        scales : Scales
            How large the signals are.

        Returns
        -------
        bool
            True by default; otherwise the special cases are enough.
        """
        return True

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Return the limits within which a fit of the effect's parameters makes sense.

        Parameters
        ----------
        target : str
            One of `targets`.
        model : PhysicsModel
            The model to extend.
        scales : Scales
            How large the signals are.

        Returns
        -------
        dict of str to tuple of float
            Lowest and highest value by field name, narrower than the quantity's own bounds.
        """
        return {}

    def characteristic(self, model: PhysicsModel) -> Characteristic | None:
        """Return the curve that a person would draw to see the effect.

        Parameters
        ----------
        model : PhysicsModel
            The extended model.

        Returns
        -------
        Characteristic or None
            What is drawn over what; None where the error with and without the effect says more.
        """
        return None

    @classmethod
    def title(cls, target: str) -> str:
        """Return what people call the effect on a target.

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
        return cls.phrase.format(effect=cls.id.replace("_", " "), target=target)

    @classmethod
    def size_field(cls) -> str:
        """Return the field that tells how strong the effect is: the first that is no shape.

        Returns
        -------
        str
            The field; empty where the effect is there or not.
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
            How large the signals are.

        Returns
        -------
        float
            The value.
        """
        name, end = cls.size_field(), cls._ends()
        return cls.limits(target, model, scales)[name][1] if name in end else 0.0

    @classmethod
    def of_size(
        cls, target: str, model: PhysicsModel, scales: Scales
    ) -> "Callable[[float], Effect]":
        """Return the effect as a function of its size.

        Size 0 does nothing. Size 1 is a force as large as the typical inertial force, a bias or a
        dead zone as large as the signal's ups and downs, a limit that lets nothing through, a delay
        as long as a window. Shapes take the middle of the values a fit would start from.

        Parameters
        ----------
        target : str
            One of `targets`.
        model : PhysicsModel
            The model to extend.
        scales : Scales
            How large the signals are.

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

        def value(quantity, size):
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
            How large the signals are.

        Returns
        -------
        dict of str to float
            Value by kind, as `units` names them.
        """
        return typical_by_kind(target, model, scales)

    @classmethod
    def _ends(cls) -> frozenset[str]:
        """Return the fields that are where something ends."""
        return frozenset(f.name for f in cls.quantities() if f.metadata["role"] == "end")

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
            Whether the target is one of `targets`; an effect may act on more than is looked for.
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
            One for every `quantity`.
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
        changes = self.rewrite(model, symbols)
        parameters = {**changes.pop("parameters", model.parameters), **new}
        return model.replace(parameters=parameters, **changes)

    def _repr_html_(self) -> str:
        return reading("effect_html")(self)

    def _repr_latex_(self) -> str | None:
        return reading("effect_latex")(self)


def _end(quantity, usual: float, limits: tuple[float, float], size: float) -> float:
    """Return an end: of a range in proportion, of a rate the usual one at half the size."""
    if "/s" in quantity.metadata["unit"] or "rate" in quantity.metadata["unit"]:
        return usual * (1.0 - size) / max(size, 1e-9)
    return (1.0 - size) * (limits[1] if quantity.default > 0 else limits[0])
