"""The catalogue: every physical cause a diagnosis knows. A new effect is one class, listed once."""

from sklearn_pgnn.physics.effects.inputs import (
    ActuatorLag,
    InputBias,
    InputDeadZone,
    InputDelay,
    InputSaturation,
)
from sklearn_pgnn.physics.effects.outputs import SensorBias, SensorGain
from sklearn_pgnn.physics.effects.parameters import WrongParameter
from sklearn_pgnn.physics.effects.rates import (
    AsymmetricFriction,
    Cogging,
    ConstantLoad,
    CoulombFriction,
    CubicStiffness,
    LinearStiffness,
    QuadraticDrag,
    StribeckFriction,
    ViscousFriction,
)

CATALOGUE = (
    CoulombFriction,
    StribeckFriction,
    AsymmetricFriction,
    ViscousFriction,
    QuadraticDrag,
    LinearStiffness,
    CubicStiffness,
    ConstantLoad,
    Cogging,
    InputDeadZone,
    InputSaturation,
    InputDelay,
    ActuatorLag,
    InputBias,
    SensorBias,
    SensorGain,
    WrongParameter,
)

__all__ = ["CATALOGUE", *(effect.__name__ for effect in CATALOGUE)]
