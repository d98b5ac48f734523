"""The command that writes a model file in the language of another tool."""

import shutil
import zipfile

import pytest
from click.testing import CliRunner

from sklearn_pgnn import effects, export, systems
from sklearn_pgnn.cli import main

pytestmark = pytest.mark.core

CART = systems.cart_on_spring() + effects.InputDelay("force", 0.05)


@pytest.fixture
def model(tmp_path):
    CART.to_yaml(tmp_path / "cart.yaml")
    return tmp_path / "cart.yaml"


def run(model, target, output, *options, code=0):
    words = ["export", "--model", model, "--to", target, "--output", output, *options]
    result = CliRunner().invoke(main, [*map(str, words)])
    assert result.exit_code == code, result.output
    return result


def test_c_is_written_with_its_options(model, tmp_path):
    words = "--interval 0.01 --precision single --parameters struct --name cart"
    options = words.split()
    said = run(model, "c", tmp_path / "cart.c", *options).stdout
    assert "cart.c" in said
    written = (tmp_path / "cart.c").read_text(encoding="utf-8")
    assert written == export.to_c(CART, 0.01, precision="single", parameters="struct", name="cart")


def test_a_unit_and_a_text_of_modelica_are_written(model, tmp_path):
    run(model, "fmu", tmp_path / "a.fmu", "--interval", 0.01, "--fmi", 3, "--compiler", "none")
    with zipfile.ZipFile(tmp_path / "a.fmu") as archive:
        assert "sources/fmu.c" in archive.namelist()
        assert b'fmiVersion="3.0"' in archive.read("modelDescription.xml")
    assert run(model, "modelica", tmp_path / "cart.mo", "--quiet").stdout == ""
    assert (tmp_path / "cart.mo").read_text(encoding="utf-8") == export.to_modelica(CART)


def test_a_unit_as_a_model_is_refused_for_it_has_no_equations(tmp_path):
    pytest.importorskip("fmpy")
    if shutil.which("gcc") is None:
        pytest.skip("no gcc here")
    unit = tmp_path / "cart.fmu"
    export.to_fmu(systems.cart_on_spring(), unit, interval=0.01)
    said = run(unit, "c", tmp_path / "cart.c", "--interval", 0.01, code=2).stderr
    assert "expected a model given by equations" in said


def test_nothing_is_replaced_unasked(model, tmp_path):
    (tmp_path / "cart.mo").write_text("mine")
    assert "expected a new file" in run(model, "modelica", tmp_path / "cart.mo", code=2).stderr
    assert (tmp_path / "cart.mo").read_text() == "mine"
    run(model, "modelica", tmp_path / "cart.mo", "--force")
    assert (tmp_path / "cart.mo").read_text() != "mine"


@pytest.mark.parametrize(
    ("target", "options", "what"),
    [
        ("c", (), "--interval: --to c needs it"),
        ("modelica", ("--fmi", "3"), "--fmi: --to modelica takes --friction-width"),
        ("fmu", ("--interval", "0.01", "--compiler", "no-cc"), "compiler=None"),
    ],
)
def test_options_that_do_not_fit_are_said_in_one_line(model, tmp_path, target, options, what):
    said = run(model, target, tmp_path / "out", "--quiet", *options, code=2).stderr
    assert what in said
    assert len(said.strip().splitlines()) == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cart.yaml"]


def test_what_the_target_cannot_express_is_refused_with_the_remedy(tmp_path):
    systems.golf_robot().to_yaml(tmp_path / "robot.yaml")
    said = run(tmp_path / "robot.yaml", "modelica", tmp_path / "robot.mo", code=2).stderr
    assert "'omega' sticks in dry friction" in said
    assert "friction_width" in said
