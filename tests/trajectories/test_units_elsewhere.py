"""Units that stand above the header, that tools spell differently, and that a remedy names."""

import re

import pytest

from sklearn_pgnn.exceptions import RecordError, RecordWarning
from sklearn_pgnn.physics import PhysicsModel
from sklearn_pgnn.physics.units import conversion
from sklearn_pgnn.trajectories import read_file

pytestmark = pytest.mark.core

OVEN = PhysicsModel(
    {"T": "K", "x": "m"},
    {"T": "(T_air - T)/tau + power/C", "x": "power/F"},
    {"tau": 30.0, "C": 50.0, "F": 9.0, "T_air": 290.0},
    {"power": "W"},
    {"temperature": "T", "stretch": "x"},
)
SAMPLES = "0 1.5 20 7\n1 1.5 21 8\n2 2.5 23 9\n3 2.5 24 9\n".replace(" ", "\t")
LABVIEW = (
    "LabVIEW Measurement\t\nSeparator\tTab\nOperator\tA\n***End_of_Header***\t\n\t\n"
    "Channels\t3\t\t\t\nSamples\t4\t4\t4\t\nDate\t2026/01/31\t2026/01/31\t2026/01/31\t\n"
    "Y_Unit_Label\tkW\tdegC\tmm\t\nX_Dimension\tTime\tTime\tTime\t\nDelta_X\t1.0\t1.0\t1.0\t\n"
    "***End_of_Header***\t\t\t\t\nt\tpower\ttemperature\tstretch\tComment\n"
)


def read(folder, text, model=OVEN):
    path = folder / "run.txt"
    path.write_text(text)
    X, y = read_file(path, model)
    return X["power"].iloc[0], y["temperature"].iloc[0], y["stretch"].iloc[0]


@pytest.mark.parametrize(
    "head",
    [
        "s\tkW\t°C\tmm\nt\tpower\ttemperature\tstretch\n",
        "rig 7\n(s)\t(kW)\t(°C)\t(mm)\ndrive\tdrive\toven\tlaser\nt\tpower\ttemperature\tstretch\n",
        LABVIEW,
        "! oven\n! t\tpower\ttemperature\tstretch\n! s\tkW\tdegC\tmm\n",
        "// oven\n# s\tkW\tdegC\tmm\n# t\tpower\ttemperature\tstretch\n",
        "t: s\tpower: kW\ttemperature: °C\tstretch: mm\n",
        "t\tpower\ttemperature\tstretch\nSeconds\tkW\tCelsius\tmm\n",
    ],
    ids=range(7),
)
def test_units_are_read_wherever_they_stand(tmp_path, head):
    assert read(tmp_path, head + SAMPLES) == pytest.approx((1500, 293.15, 0.007))


def test_letters_that_count_columns_are_no_units(tmp_path):
    text = "A\tB\tC\tD\nt\tpower\ttemperature\tstretch\n" + SAMPLES
    assert read(tmp_path, text) == (1.5, 20.0, 7.0)


@pytest.mark.parametrize(
    ("given", "wanted", "known"),
    [
        ("celsius", "K", (1.0, 273.15)),
        ("degreeC", "K", (1.0, 273.15)),
        ("fahrenheit", "celsius", (5 / 9, -160 / 9)),
        ("J/celsius", "J/K", (1.0, 0.0)),
        ("N.m", "N m", (1.0, 0.0)),
        ("mm·s⁻²", "m/s^2", (1e-3, 0.0)),
        ("Volts", "mV", (1e3, 0.0)),
    ],
)
def test_units_are_known_by_all_their_names(given, wanted, known):
    assert conversion(given, wanted) == pytest.approx(known)


@pytest.mark.parametrize(("given", "wanted"), [("dB", "1"), ("dBm", "W"), ("0.1 degC", "K")])
def test_no_factor_stands_for_a_logarithm_or_another_zero(given, wanted):
    assert conversion(given, wanted) is None


def test_the_remedy_followed_to_the_letter_gives_the_record(tmp_path):
    text = "t_s,drive power: raw,temperature_C,stretch_mm\n" + SAMPLES.replace("\t", ",")
    with pytest.raises(RecordError) as caught:
        read(tmp_path, text)
    columns = re.search(r"columns: \{.*?\}", str(caught.value))[0]
    OVEN.to_yaml(tmp_path / "model.yaml")
    model = tmp_path / "model.yaml"
    model.write_text(f"{model.read_text()}\n{columns}\n")
    told = read(tmp_path, text, PhysicsModel.from_yaml(model))
    assert told == pytest.approx((1.5, 293.15, 0.007))


def test_a_name_that_tells_a_temperature_is_not_read_in_kelvin_unsaid(tmp_path):
    model = OVEN.replace(columns={"temperature": "temperature_C"})
    text = "t,power,temperature_C,stretch\n" + SAMPLES.replace("\t", ",")
    with pytest.warns(RecordWarning, match=r'ends in .C.\. Remedy: .*"temperature_C \[degC\]"'):
        read(tmp_path, text, model)


def test_a_column_given_twice_has_a_remedy(tmp_path):
    text = "t,power,temperature,stretch,power\n" + SAMPLES.replace("\t", ",")
    with pytest.raises(RecordError, match=r"got it 2 times\. Remedy: keep the right one"):
        read(tmp_path, text)
