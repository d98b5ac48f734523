"""The catalogue: every physical cause a diagnosis knows. A new effect is one class, listed once."""

from sklearn_pgnn.physics.effects.formula import Formula
from sklearn_pgnn.physics.effects.friction import (
    AsymmetricFriction,
    CoulombFriction,
    Hysteresis,
    QuadraticDrag,
    StribeckFriction,
    ViscousFriction,
)
from sklearn_pgnn.physics.effects.inputs import (
    ActuatorLag,
    InputBacklash,
    InputBias,
    InputDeadZone,
    InputDelay,
    InputGain,
    InputRateLimit,
    InputSaturation,
)
from sklearn_pgnn.physics.effects.levels import Leak, RateLimit, StateLimit
from sklearn_pgnn.physics.effects.outputs import (
    SensorBias,
    SensorDelay,
    SensorGain,
    SensorRectification,
    SensorSaturation,
)
from sklearn_pgnn.physics.effects.overflow import Overflow
from sklearn_pgnn.physics.effects.parameters import ParameterDrift, WrongParameter
from sklearn_pgnn.physics.effects.rates import ConstantLoad, PeriodicDisturbance
from sklearn_pgnn.physics.effects.springs import (
    Cogging,
    CubicStiffness,
    EndStop,
    LinearStiffness,
    QuadraticStiffness,
)

CATALOGUE = (
    CoulombFriction,
    StribeckFriction,
    AsymmetricFriction,
    ViscousFriction,
    QuadraticDrag,
    LinearStiffness,
    QuadraticStiffness,
    CubicStiffness,
    ConstantLoad,
    Cogging,
    EndStop,
    Hysteresis,
    PeriodicDisturbance,
    RateLimit,
    StateLimit,
    Overflow,
    Leak,
    InputBias,
    InputGain,
    InputDeadZone,
    InputSaturation,
    InputDelay,
    ActuatorLag,
    InputRateLimit,
    InputBacklash,
    SensorBias,
    SensorGain,
    SensorSaturation,
    SensorRectification,
    SensorDelay,
    WrongParameter,
    ParameterDrift,
)

__all__ = ["CATALOGUE", "Formula", *(effect.__name__ for effect in CATALOGUE)]
