"""An effect: a rewriting of a model that has a name."""

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from types import MappingProxyType
from typing import ClassVar

import sympy

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.parameter import Parameter


def quantity(letter, unit, default=0.0, low=-math.inf, high=math.inf):
    """Declare a physical parameter of an effect as a dataclass field.

    Parameters
    ----------
    letter : str
        Symbol it gets in the equations, before the target's name.
    unit : str
        What it measures: a template over the units that `Effect.units` gives, e.g.
        ``"{force}/({velocity})"``.
    default : float, default=0.0
        Value at which the effect does nothing, or its usual one.
    low, high : float
        Bounds.

    Returns
    -------
    dataclasses.Field
        The field.
    """
    return field(
        default=default, metadata={"letter": letter, "unit": unit, "low": low, "high": high}
    )


@dataclass(frozen=True)
class Scales:
    """How large the signals of a record are; effects take their start values from it.

    Parameters
    ----------
    typical, peak : mapping of str to float
        Root mean square about the mean, and largest magnitude, of every state, input and output.
    rate : mapping of str to float
        Root mean square of every state's rate of change [unit of the state per second].
    sample_time : float
        Median time between samples [s].
    window : float
        Length of the windows the model is judged on [s].
    duration : float, default=inf
        Length of the longest record [s].
    latest : float, default=inf
        Largest time of a record [s]: more than `duration` behind a gap, or where a model's own
        equations contain the time and its records begin late.
    tones, ripples : mapping of str to tuple of float
        For velocities, frequencies [Hz] and periods in position that stand out in what the model
        lacks of their rate; frequencies in what it leaves of the outputs, too.
    extremes : mapping of str to tuple of float
        Least and largest value of states, inputs and outputs; without it, the magnitude both ways.
    """

    typical: Mapping[str, float]
    peak: Mapping[str, float]
    rate: Mapping[str, float]
    sample_time: float
    window: float
    duration: float = math.inf
    latest: float = math.inf
    tones: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    ripples: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    extremes: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def ends(self, name: str, below: float = 0.0, above: float = 0.0) -> tuple[float, float]:
        """Give a signal's range, the ends moved inwards by shares of it.

        Examples
        --------
        >>> scales = Scales({}, {"y": 2.0}, {}, 0.01, 1.0)
        >>> scales.ends("y"), scales.ends("y", below=0.25)
        ((-2.0, 2.0), (-1.0, 2.0))
        """
        low, high = self.extremes.get(name, (-self.peak.get(name, 0.0), self.peak.get(name, 0.0)))
        return low + below * (high - low), high - above * (high - low)


@dataclass(frozen=True)
class Effect(ABC):
    """A named rewriting of a model; ``model + effect`` is again a model.

    To write your own: a frozen dataclass with an ``id``, a `quantity` for every physical
    parameter, and the methods `targets`, `rewrite` and `starts`.

    Parameters
    ----------
    target : str
        The state, input, output or parameter the effect acts on.
    """

    target: str
    #: the effect's name in a diagnosis
    id: ClassVar[str]
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
        """Name the quantities of a model that the effect can act on.

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
        """Say what the effect changes.

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
        """Propose where a fit of the effect may start.

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

    @classmethod
    def limits(cls, target: str, model: PhysicsModel, scales: Scales) -> dict:
        """Say within what a fit of the effect's parameters makes sense on a record.

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

    @classmethod
    def quantities(cls) -> tuple:
        """Give the fields that are physical parameters."""
        return tuple(f for f in fields(cls) if "letter" in f.metadata)

    def names(self) -> dict[str, str]:
        """Give the model's name of every physical parameter, by field name."""
        return {f.name: f"{f.metadata['letter']}_{self.target}" for f in self.quantities()}

    def units(self, model: PhysicsModel) -> dict[str, str]:
        """Give the units that the parameters' unit templates speak of.

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
        """Give the effect's physical parameters as the extended model holds them.

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
                unit=_tidy_unit(f.metadata["unit"].format(**units)),
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
        possible = self.targets(model)
        if self.target not in possible:
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


def _tidy_unit(unit: str) -> str:
    """Drop what an empty or dimensionless unit leaves behind."""
    unit = re.sub(r"/\(?(1)?\)?(?=$|\s)", "", unit)
    return re.sub(r"\((\w+)\)", r"\1", unit).strip()
