"""The catalogue of physical causes for a diagnosis. A new effect is one class, listed once."""

from collections.abc import Iterable, Iterator
from difflib import get_close_matches

from sklearn_pgnn.exceptions import OptionError
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.effects.dependences import (
    InputFading,
    ParameterSaturation,
    ParameterSlope,
)
from sklearn_pgnn.physics.effects.directions import CoefficientByDirection
from sklearn_pgnn.physics.effects.formula import Formula
from sklearn_pgnn.physics.effects.friction import (
    AsymmetricFriction,
    CoulombFriction,
    Hysteresis,
    LoadFriction,
    QuadraticDrag,
    StribeckFriction,
    ViscousFriction,
)
from sklearn_pgnn.physics.effects.gear_friction import GearLoss, LoadStribeckFriction
from sklearn_pgnn.physics.effects.inputs import (
    ActuatorLag,
    AsymmetricDeadZone,
    InputBacklash,
    InputBias,
    InputCurve,
    InputDeadZone,
    InputDelay,
    InputGain,
    InputPower,
    InputRateLimit,
    InputSaturation,
)
from sklearn_pgnn.physics.effects.joints import ElasticJoint, JointPlay, SpringPlay
from sklearn_pgnn.physics.effects.levels import (
    Leak,
    LeakToLevel,
    Overflow,
    RateLimit,
    StateLimit,
)
from sklearn_pgnn.physics.effects.losses import LeakToInput, PowerLoss, RadiationLoss
from sklearn_pgnn.physics.effects.outputs import (
    SensorBias,
    SensorCurvature,
    SensorDelay,
    SensorEccentricity,
    SensorGain,
    SensorLag,
    SensorRectification,
    SensorSaturation,
)
from sklearn_pgnn.physics.effects.parameters import ParameterDrift, WrongParameter
from sklearn_pgnn.physics.effects.rates import ConstantLoad, PeriodicDisturbance
from sklearn_pgnn.physics.effects.springs import (
    Cogging,
    CubicStiffness,
    EndStop,
    HystereticSpring,
    LinearStiffness,
    QuadraticStiffness,
)
from sklearn_pgnn.physics.effects.stores import (
    MaxwellBranch,
    RelaxationBranch,
    SecondStore,
    StoreBetween,
    TwoRelaxationBranches,
)

CATALOGUE: tuple[type[Effect], ...] = (
    CoulombFriction,
    StribeckFriction,
    AsymmetricFriction,
    LoadFriction,
    GearLoss,
    LoadStribeckFriction,
    ViscousFriction,
    QuadraticDrag,
    LinearStiffness,
    QuadraticStiffness,
    CubicStiffness,
    ConstantLoad,
    Cogging,
    EndStop,
    Hysteresis,
    HystereticSpring,
    ElasticJoint,
    JointPlay,
    SpringPlay,
    MaxwellBranch,
    PeriodicDisturbance,
    RateLimit,
    StateLimit,
    Overflow,
    Leak,
    LeakToLevel,
    LeakToInput,
    PowerLoss,
    RadiationLoss,
    SecondStore,
    StoreBetween,
    InputBias,
    InputGain,
    InputDeadZone,
    AsymmetricDeadZone,
    InputSaturation,
    InputFading,
    InputDelay,
    ActuatorLag,
    InputRateLimit,
    InputBacklash,
    InputPower,
    InputCurve,
    SensorBias,
    SensorGain,
    SensorCurvature,
    SensorEccentricity,
    SensorSaturation,
    SensorRectification,
    SensorDelay,
    SensorLag,
    RelaxationBranch,
    TwoRelaxationBranches,
    WrongParameter,
    CoefficientByDirection,
    ParameterDrift,
    ParameterSlope,
    ParameterSaturation,
)

#: what is found most often on machines, in this order: wrong numbers, dry and viscous friction,
#: what the actuator leaves out, offsets and scales, delays. A search fits these first, so that a
#: short time limit reaches them; the result of one that finishes does not depend on the order
FREQUENT: tuple[type[Effect], ...] = (
    WrongParameter,
    CoulombFriction,
    ViscousFriction,
    InputDeadZone,
    InputSaturation,
    InputBias,
    SensorBias,
    InputGain,
    SensorGain,
    ConstantLoad,
    Leak,
    InputDelay,
    ActuatorLag,
    QuadraticDrag,
    AsymmetricFriction,
    LinearStiffness,
    InputBacklash,
    SecondStore,
    RelaxationBranch,
    SensorSaturation,
)

#: with several numbers, or states that no output tells, these imitate simpler effects: they are
#: tried after the others, and have to refute what was found
FURTHER: frozenset[type[Effect]] = frozenset(
    {
        LoadStribeckFriction,
        GearLoss,
        HystereticSpring,
        ElasticJoint,
        JointPlay,
        SpringPlay,
        MaxwellBranch,
        StoreBetween,
        TwoRelaxationBranches,
        InputFading,
        InputCurve,
    }
)

__all__ = ["CATALOGUE", "Formula", "by_id", *(effect.__name__ for effect in CATALOGUE)]


def by_id(effect: str) -> type[Effect]:
    """Return the effect of the catalogue with a given id.

    Parameters
    ----------
    effect : str
        Its id, as used in a diagnosis and its report.

    Returns
    -------
    type[Effect]
        The effect.

    Raises
    ------
    OptionError
        If the catalogue has none with that id.

    Examples
    --------
    >>> by_id("coulomb_friction").__name__
    'CoulombFriction'
    """
    kinds = {kind.id: kind for kind in CATALOGUE}
    if effect in kinds:
        return kinds[effect]
    near = get_close_matches(effect, kinds, n=1)
    meant = f"did you mean {near[0]!r}?" if near else f"one of {', '.join(kinds)}."
    raise OptionError(f"catalogue: expected the id of an effect, got {effect!r}; {meant}")


def frequent_first(causes: Iterable[Effect]) -> tuple[Effect, ...]:
    """Return effects in the order of `FREQUENT`, all others after these in their own order."""
    place = {kind: i for i, kind in enumerate(FREQUENT)}
    return tuple(sorted(causes, key=lambda cause: place.get(type(cause), len(place))))


def find_effect(effect: str) -> type[Effect]:
    """Return the effect with a given id: of the catalogue, or any other that is defined."""
    own = [kind for kind in _kinds_of(Effect) if getattr(kind, "id", None) == effect]
    catalogued = any(kind.id == effect for kind in CATALOGUE)
    return by_id(effect) if catalogued or not own else own[-1]


def _kinds_of(kind: type) -> Iterator[type]:
    """Yield every class that is derived from another."""
    derived: type
    for derived in kind.__subclasses__():
        yield derived
        yield from _kinds_of(derived)


def read_catalogue(catalogue: Iterable[type[Effect] | str] | None) -> tuple[type[Effect], ...]:
    """Return the effects that a parameter ``catalogue`` stands for.

    >>> read_catalogue(["leak", Cogging]) == (Leak, Cogging)
    True
    """
    if catalogue is None:
        return CATALOGUE
    if isinstance(catalogue, str) or not isinstance(catalogue, Iterable):
        raise OptionError(
            f"catalogue: expected a sequence of effects or of their ids, got {catalogue!r}. "
            f"Remedy: [effects.CoulombFriction], or ['coulomb_friction']."
        )
    kinds = tuple(find_effect(kind) if isinstance(kind, str) else kind for kind in catalogue)
    for kind in kinds:
        if not (isinstance(kind, type) and issubclass(kind, Effect)):
            raise OptionError(
                f"catalogue: expected effects (the classes, without a target) or their ids, "
                f"got {kind!r}."
            )
    return kinds
