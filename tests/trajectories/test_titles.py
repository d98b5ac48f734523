"""Units in the headers of files: converted, refused, or taken for a remark."""

import pytest

from sklearn_pgnn.exceptions import RecordError, RecordWarning
from sklearn_pgnn.physics import PhysicsModel
from sklearn_pgnn.trajectories import read_file
from sklearn_pgnn.trajectories.titles import names_alike, units_alike

pytestmark = pytest.mark.core

MODEL = PhysicsModel(
    {"v": "m/s"}, {"v": "(F - d*v)/m"}, {"m": 2.0, "d": 0.5}, {"F": "N"}, {"speed": "v"}
)


def write(folder, header):
    path = folder / "run.csv"
    path.write_text(f"{header}\n0,1,2\n1,1,3\n2,1,4\n3,1,5\n")
    return path


@pytest.mark.parametrize(
    ("header", "factors"),
    [
        ("t [s],F [N],speed [m/s]", (1, 1, 1)),
        ("t [ms],F [kN],speed [km/h]", (1e-3, 1e3, 1 / 3.6)),
        ("t (min),F,speed (mm/s)", (60, 1, 1e-3)),
        ("t [s],F (as commanded),speed (filtered)", (1, 1, 1)),
    ],
)
def test_a_column_is_converted_to_the_unit_of_the_model(tmp_path, header, factors):
    X, y = read_file(write(tmp_path, header), MODEL)
    time, force, speed = factors
    assert X["t"].to_numpy() == pytest.approx([0, time, 2 * time, 3 * time])
    assert X["F"].to_numpy() == pytest.approx([force] * 4)
    assert y["speed"].to_numpy() == pytest.approx([2 * speed, 3 * speed, 4 * speed, 5 * speed])


@pytest.mark.parametrize("header", ["t,F [V],speed", "t,F (V),speed", "t,F [?],speed"])
def test_a_unit_of_another_kind_is_refused(tmp_path, header):
    with pytest.raises(RecordError, match=r"run.csv:1: column 'F .*expected the unit 'N'"):
        read_file(write(tmp_path, header), MODEL)


def test_a_model_without_units_takes_every_column_as_it_is(tmp_path):
    model = PhysicsModel({"v": ""}, {"v": "F - v"}, inputs={"F": ""}, outputs={"speed": "v"})
    X, _ = read_file(write(tmp_path, "t,F [kN],speed [mm/s]"), model)
    assert X["F"].tolist() == [1.0] * 4


def test_a_time_whose_name_ends_in_milliseconds_is_asked_about(tmp_path):
    path = write(tmp_path, "time_ms,F,speed")
    with pytest.raises(RecordError, match=r'columns: \{t: "time_ms \[ms\]"\}'):
        read_file(path, MODEL)
    with pytest.warns(RecordWarning, match=r"read as t in s, but its name ends in 'ms'. Remedy: "):
        X, _ = read_file(path, MODEL.replace(columns={"t": "time_ms"}))
    assert X["t"].to_numpy() == pytest.approx([0, 1, 2, 3])


def test_a_number_at_the_end_of_a_name_is_no_unit(tmp_path, recwarn):
    angle = PhysicsModel(
        {"phi": "rad"}, {"phi": "u - phi"}, {}, {"u": "rad"}, columns={"u": "d_1", "phi": "d_3"}
    )
    read_file(write(tmp_path, "t,d_1,d_3"), angle)
    assert not recwarn


@pytest.mark.parametrize("shown", ["v/n", "2*v/n", "m*v/n"])
def test_an_output_whose_expression_is_in_another_unit_is_asked_about(tmp_path, recwarn, shown):
    parameters = {"m": {"value": 2.0, "unit": "kg"}, "d": 0.5, "n": 10.0}
    model = MODEL.replace(parameters=parameters, outputs={"speed": shown})
    read_file(write(tmp_path, "t,F,speed [km/h]"), model)
    said = [str(warning.message) for warning in recwarn]
    if shown == "v/n":
        (warning,) = said
        assert "is read as it stands, in km/h, but the model's speed = v/n is in m/s" in warning
        assert 'outputs: {speed: "3.6*(v/n)"}' in warning
    else:  # the number may be the conversion; a momentum is no speed at all
        assert said == []


def test_a_unit_in_the_models_columns_converts_and_asks_no_more(tmp_path, recwarn):
    columns = {"t": "time_ms [ms]", "speed": "speed_mm [m/s]"}
    X, y = read_file(write(tmp_path, "time_ms,F,speed_mm"), MODEL.replace(columns=columns))
    assert X["t"].to_numpy() == pytest.approx([0, 1e-3, 2e-3, 3e-3])
    assert y["speed"].to_numpy() == pytest.approx([2, 3, 4, 5])
    assert not recwarn.list


@pytest.mark.parametrize("title", ["F_d", "F_2", "F_l", "F_N"])
def test_a_letter_at_the_end_of_a_name_is_no_unit_of_another_kind(tmp_path, recwarn, title):
    read_file(write(tmp_path, f"t,{title},speed"), MODEL.replace(columns={"F": title}))
    assert not recwarn.list


# -- names and units that are alike, and those that are not ----------------------------------------


@pytest.mark.parametrize(
    ("own", "theirs"),
    [("force", "F_force"), ("position", "Pos"), ("speed", "spd"), ("motor_torque", "torque (raw)")],
)
def test_names_that_share_a_word_or_their_letters_are_alike(own, theirs):
    assert names_alike(own, theirs)
    assert names_alike(theirs, own)


@pytest.mark.parametrize(
    ("own", "theirs"),
    [("force", "weg"), ("force_1", "level_1"), ("level", "valve"), ("t", "torque")],
)
def test_names_with_little_in_common_are_not_alike(own, theirs):
    assert not names_alike(own, theirs)
    assert not names_alike(theirs, own)


def test_an_unknown_unit_is_like_none():
    assert not units_alike("N", "")
    assert not units_alike("", "")
    assert not units_alike("N", "foo")
