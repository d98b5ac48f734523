"""What is known of a channel decides which faults are candidates, and is refused if unknown."""

import inspect
import re
from pathlib import Path

import pytest

from sklearn_pgnn import PhysicsModel, effects
from sklearn_pgnn.estimation.possible_causes import possible_causes
from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics import channel_kinds
from sklearn_pgnn.physics.channel_kinds import ACTUATOR, FAULTS, OF_SENSORS, SENSORS, usual_kind
from sklearn_pgnn.physics.effects.inputs import ActuatorEffect, Delay, InputEffect
from sklearn_pgnn.physics.effects.outputs import OutputEffect
from sklearn_pgnn.physics.effects.rates import worded_for

pytestmark = pytest.mark.core
DOCS = Path(__file__).parents[2] / "docs"


def room(**channels):
    """Return a heated room with a measured temperature outside, of which something is known."""
    return PhysicsModel(
        {"T": "degC"},
        {"T": "(Q - G*(T - Ta))/C"},
        {"G": 9.0, "C": 1e5},
        inputs={"Q": "W", "Ta": "degC"},
        outputs={"room": "T"},
        channels=channels,
    )


def candidates(model, target):
    """Return the ids of the candidates on a channel."""
    every = possible_causes(model, effects.CATALOGUE)
    return {cause.id for cause in every if cause.target == target}


def test_a_measured_input_has_no_actuator_but_a_sensor():
    kept = candidates(room(Ta="measured"), "Ta")
    assert kept == {"input_bias", "input_gain", "input_delay"}
    assert kept < candidates(room(), "Ta") == candidates(room(Ta="commanded"), "Ta")
    assert candidates(room(Ta="measured"), "Q") == candidates(room(), "Q")


@pytest.mark.parametrize("kind", SENSORS)
def test_a_sensor_has_the_faults_of_its_kind_and_the_plant_all_of_its_own(kind):
    told, untold = (set(possible_causes(m, effects.CATALOGUE)) for m in (room(room=kind), room()))
    left_out = untold - told
    assert told < untold or not left_out
    assert {cause.target for cause in left_out} <= {"room"}
    assert {cause.fault for cause in left_out}.isdisjoint(SENSORS[kind])
    assert {c.fault for c in told if c.target == "room" and c.fault} <= set(SENSORS[kind])


def test_an_encoder_neither_bends_nor_clips_and_a_thermocouple_has_a_sign():
    assert candidates(room(room="encoder"), "room") >= {"sensor_bias", "sensor_gain"}
    for kind, id in (
        ("encoder", "sensor_saturation"),
        ("encoder", "sensor_curvature"),
        ("thermocouple", "sensor_rectification"),
        ("thermocouple", "sensor_saturation"),
        ("pulse_counter", "sensor_bias"),
    ):
        assert id in candidates(room(), "room")
        assert id not in candidates(room(room=kind), "room")


def test_every_effect_of_an_actuator_or_a_sensor_says_which_fault_it_is():
    for effect in effects.CATALOGUE:
        of_sensor = issubclass(effect, OutputEffect | effects.SensorLag)
        of_channel = of_sensor or issubclass(effect, InputEffect | ActuatorEffect | Delay)
        known = OF_SENSORS if of_sensor else OF_SENSORS | {ACTUATOR}
        assert (effect.fault in known) if of_channel else not effect.fault, effect.id


def test_an_effect_of_ones_own_is_a_candidate_whatever_is_known():
    class Flicker(OutputEffect):
        id = "flicker"
        starts = classmethod(lambda cls, target, model, scales: (cls(target),))

    model = room(room="encoder", Q="measured")
    assert set(possible_causes(model, (Flicker,))) == {Flicker("room")}


@pytest.mark.parametrize(
    ("channels", "said"),
    [
        (
            {"G": "encoder"},
            "channels: expected an input or an output (Q, Ta, room), got 'G'. Remedy: name a "
            "channel of the model.",
        ),
        ({"room": "tachometr"}, "got 'tachometr'. Remedy: write tachometer."),
        ({"room": "commanded"}, "channels.room: expected one of encoder, "),
        ({"Q": "bananas"}, "got 'bananas'. Remedy: leave out what is none of these."),
        ({"Q": 3}, "channels.Q: expected one of commanded, measured, encoder, "),
        ("measured", "channels: expected names and kinds, got 'measured'."),
    ],
)
def test_what_is_no_channel_and_no_kind_is_refused_with_its_remedy(channels, said):
    with pytest.raises(ModelError, match=re.escape(said)):
        room().replace(channels=channels)


def test_a_model_file_keeps_channels_and_says_where_one_is_wrong(tmp_path):
    model, file = room(Ta="measured", room="thermocouple"), tmp_path / "room.yaml"
    text = model.to_yaml(file)
    assert "channels: {Ta: measured, room: thermocouple}" in text
    assert PhysicsModel.from_yaml(file) == model != room()
    file.write_text(text.replace("thermocouple", "bananas"))
    with pytest.raises(ModelError, match=r"room.yaml:\d+:\d+: channels.room: expected one of"):
        PhysicsModel.from_yaml(file)


def test_effects_keep_what_is_known_and_may_be_added_by_hand():
    model = room(Ta="measured") + effects.ActuatorLag("Ta", 20.0) + effects.SensorBias("room")
    assert dict(model.channels) == {"Ta": "measured"}


def test_a_bias_of_a_measured_input_is_told_as_one_of_a_reading():
    for kind in ("measured", "thermocouple"):
        summary, check = worded_for(room(Ta=kind), effects.InputBias("Ta"))
        assert "reading" in summary
        assert "Command" not in check
    assert "command" in worded_for(room(Ta="commanded"), effects.InputBias("Ta"))[0]
    every = [e for e in effects.CATALOGUE if e.fault in OF_SENSORS and e.id.startswith("input_")]
    assert all(len(effect.of_reading) == 2 for effect in every)


@pytest.mark.parametrize(
    ("unit", "names"),
    [
        ("rad", {"q": "encoder", "pot_1": "potentiometer", "elbow": "encoder"}),
        ("m/s²", {"a": "accelerometer"}),
        ("°C", {"T": "thermocouple", "ntc_room": "thermistor"}),
        ("", {"y": "", "h_level": "level_sensor"}),
        ("m", {"x": ""}),
    ],
)
def test_what_a_sensor_usually_is_follows_from_its_name_and_unit(unit, names):
    for name, kind in names.items():
        model = PhysicsModel({name: unit}, {name: "0"})
        assert usual_kind(model, name) == kind


def test_what_an_input_usually_is_follows_from_its_name_and_unit():
    units = {"u": "V", "T_amb": "degC", "tau_cmd": "N m", "tau": "N m", "i": "A"}
    model = PhysicsModel({"x": ""}, {"x": "0"}, inputs=units)
    assert {name: usual_kind(model, name) for name in units} == {
        "u": "commanded", "T_amb": "measured", "tau_cmd": "commanded", "tau": "", "i": "",
    }  # fmt: skip


def test_the_usual_kinds_are_kinds_and_the_guide_has_the_table():
    assert {*channel_kinds._USUAL, *channel_kinds._NAMED} <= set(SENSORS)
    guide = (DOCS / "user_guide.rst").read_text(encoding="utf-8")
    for kind, faults in SENSORS.items():
        assert re.search(rf"^``{kind}`` +{', '.join(faults)}$", guide, re.MULTILINE)
    assert set(FAULTS) == {"commanded", "measured", *SENSORS}
    assert "measured" in inspect.getdoc(PhysicsModel)
