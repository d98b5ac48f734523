"""What is known of a channel: an input is commanded or measured, a sensor has a kind, with faults.

Every effect of an actuator or a sensor says what `fault` it is; the table says which of them a kind
of channel can have. A channel of which nothing is known can have all.
"""

import re
from collections.abc import Collection, Mapping
from difflib import get_close_matches
from typing import TYPE_CHECKING

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.units import plain_unit

if TYPE_CHECKING:
    from sklearn_pgnn.physics.effect import Effect
    from sklearn_pgnn.physics.model import PhysicsModel

COMMANDED, MEASURED = "commanded", "measured"
#: what an actuator does with its command, besides what a sensor may do
ACTUATOR = "actuator"
#: the faults of every kind of sensor: ``range``, it is clipped; ``magnitude``, it has no sign;
#: ``eccentricity``, an error of one cycle a turn
SENSORS: dict[str, tuple[str, ...]] = {
    "encoder": ("bias", "gain", "delay", "resolution", "eccentricity"),
    "pulse_counter": ("gain", "delay", "resolution", "magnitude"),
    "potentiometer": ("bias", "gain", "delay", "lag", "curvature", "range", "eccentricity"),
    "tachometer": ("bias", "gain", "delay", "lag", "curvature", "range", "magnitude"),
    "accelerometer": ("bias", "gain", "delay", "lag", "range"),  # gravity, when tilted, is a bias
    "gyroscope": ("bias", "gain", "delay", "lag", "range"),
    "distance_sensor": ("bias", "gain", "delay", "lag", "curvature", "range", "resolution"),
    "camera": ("bias", "gain", "delay", "resolution"),
    "thermocouple": ("bias", "gain", "delay", "lag"),
    "thermistor": ("bias", "gain", "delay", "lag", "curvature", "range"),
    "pressure_sensor": ("bias", "gain", "delay", "lag", "curvature", "range"),
    "level_sensor": ("bias", "gain", "delay", "lag", "curvature", "range"),
    "flow_meter": ("bias", "gain", "delay", "lag", "curvature", "range", "magnitude"),
    "load_cell": ("bias", "gain", "delay", "lag", "curvature", "range"),
    "current_sensor": ("bias", "gain", "delay", "lag", "range"),
    "voltmeter": ("bias", "gain", "delay", "lag", "range"),
    "light_sensor": ("bias", "gain", "delay", "lag", "curvature", "range"),
}
#: every fault of a sensor, and of any channel
OF_SENSORS = frozenset(fault for faults in SENSORS.values() for fault in faults)
FAULTS: dict[str, Collection[str]] = {
    COMMANDED: OF_SENSORS | {ACTUATOR},
    MEASURED: OF_SENSORS,
    **SENSORS,
}
#: the sensor that usually reads a quantity, by its unit
_USUAL = {
    "encoder": ("rad", "deg", "rev"),
    "tachometer": ("rad/s", "deg/s", "rpm", "rev/s"),
    "accelerometer": ("m/s**2",),
    "thermocouple": ("degC", "K"),
    "pressure_sensor": ("Pa", "kPa", "bar", "mbar", "MPa"),
    "flow_meter": ("m**3/s", "l/s", "l/min", "m**3/h"),
    "load_cell": ("N", "N*m"),
    "current_sensor": ("A", "mA"),
    "voltmeter": ("V", "mV"),
}
#: and by a word in its name, which counts for more
_NAMED = {
    "encoder": "enc",
    "potentiometer": "pot",
    "tachometer": "tach",
    "accelerometer": "acc|imu",
    "gyroscope": "gyro",
    "camera": "cam|mocap|track",
    "thermistor": "ntc|thermistor",
    "thermocouple": "thermo|temp",
    "distance_sensor": "dist|sonar|laser",
    "level_sensor": "level",
}
#: units and words of inputs that are commands, and of those that are measured
_COMMANDS, _COMMAND = ("", "%", "V"), "cmd|command|set|ref|duty|pwm"
_READINGS, _READ = ("degC", "K", "m/s**2", "W/m**2"), "meas|amb|out"


def can_have(model: "PhysicsModel", effect: "Effect") -> bool:
    """Return whether what is known of an effect's channel allows it.

    >>> from sklearn_pgnn import PhysicsModel, effects
    >>> room = PhysicsModel({"T": "degC"}, {"T": "(Q - G*(T - Ta))/C"}, {"G": 9.0, "C": 1e5},
    ...     inputs={"Q": "W", "Ta": "degC"}, channels={"Ta": "measured", "T": "thermocouple"})
    >>> can_have(room, effects.ActuatorLag("Q")), can_have(room, effects.ActuatorLag("Ta"))
    (True, False)
    >>> can_have(room, effects.SensorBias("T")), can_have(room, effects.SensorSaturation("T"))
    (True, False)
    """
    kind = model.channels.get(effect.target)
    return kind is None or not effect.fault or effect.fault in FAULTS[kind]


def is_measured(model: "PhysicsModel", name: str) -> bool:
    """Return whether a channel is an input that is known to be measured."""
    return name in model.inputs and model.channels.get(name, COMMANDED) != COMMANDED


def check_channels(channels: Mapping, inputs: Collection[str], outputs: Collection[str]) -> None:
    """Raise `ModelError` unless channels are inputs or outputs, each of a kind that it can be."""
    if not isinstance(channels or {}, Mapping):
        raise ModelError(f"channels: expected names and kinds, got {channels!r}.", ("channels",))
    for name, kind in dict(channels or {}).items():
        where = ("channels", str(name))
        if name not in {*inputs, *outputs}:
            raise ModelError(
                f"channels: expected an input or an output ({', '.join([*inputs, *outputs])}), got "
                f"{name!r}. Remedy: name a channel of the model.",
                where,
            )
        known = kinds(name in inputs)
        if kind not in known:
            near = get_close_matches(str(kind), known, n=1)
            meant = f"write {near[0]}" if near else "leave out what is none of these"
            raise ModelError(
                f"channels.{name}: expected one of {', '.join(known)}, got {kind!r}. "
                f"Remedy: {meant}.",
                where,
            )


def kinds(is_input: bool) -> tuple[str, ...]:
    """Return the kinds that an input, or an output, can be of."""
    return (COMMANDED, MEASURED, *SENSORS) if is_input else tuple(SENSORS)


def usual_kind(model: "PhysicsModel", name: str) -> str:
    """Return what a channel usually is, by its name and unit; empty where that may be anything."""
    unit = plain_unit(model.unit(name))
    if name in model.inputs:
        is_command = _has(name, _COMMAND) or unit in _COMMANDS
        is_reading = _has(name, _READ) or unit in _READINGS
        return COMMANDED if is_command else MEASURED if is_reading else ""
    told = (kind for kind, words in _NAMED.items() if _has(name, words))
    return next(told, next((kind for kind, units in _USUAL.items() if unit in units), ""))


def _has(name: str, words: str) -> bool:
    """Return whether a name has one of some words, or what begins with one."""
    return re.search(rf"(^|[_\d])({words})", name.lower()) is not None


def in_words(model: "PhysicsModel") -> str:
    """Return what a model says of its channels, and of which it says nothing."""
    said = [f"{name} is {_article(kind)}" for name, kind in model.channels.items()]
    open_ = [name for name in (*model.inputs, *model.outputs) if name not in model.channels]
    every = f"of {', '.join(open_)} nothing is known, and every fault is considered"
    usual = {name: kind for name in open_ if (kind := usual_kind(model, name))}
    if usual:
        told = ", ".join(f"{name}: {kind}" for name, kind in usual.items())
        every += f"; if it is so, channels: {{{told}}} in the model file saves time and wrong names"
    return "; ".join(filter(None, [", ".join(said), every if open_ else ""]))


def _article(kind: str) -> str:
    """Return a kind as a sentence has it."""
    if kind in (COMMANDED, MEASURED):
        return kind
    return f"read by {'an' if kind[0] in 'aeiou' else 'a'} {kind.replace('_', ' ')}"
