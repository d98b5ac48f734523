"""A model file names a robot's description, and says what may be said besides."""

import sys

import pytest
from robots import six_axes

from sklearn_pgnn import PhysicsModel
from sklearn_pgnn.exceptions import ModelError, ModelWarning
from sklearn_pgnn.priors import from_urdf
from sklearn_pgnn.priors.robot_section import described_in, relative_to

HEAD = "name: arm\nrobot: {file: six.urdf}\n"


@pytest.fixture
def written(tmp_path):
    """Return a function that writes a model file beside a robot's, and returns where."""
    (tmp_path / "six.urdf").write_text(six_axes(2))

    def write(text):
        (tmp_path / "model.yaml").write_text(text)
        return tmp_path / "model.yaml"

    return write


def test_a_robot_is_read_from_the_folder_of_the_model_file(written):
    pytest.importorskip("mujoco")
    path = written(HEAD)
    robot = from_urdf(path.parent / "six.urdf")
    assert PhysicsModel.from_yaml(path) == robot.replace(name="arm")
    assert described_in(path) == path.parent / "six.urdf" == described_in(path.parent / "six.urdf")


def test_values_columns_outputs_and_options_are_told(written):
    pytest.importorskip("mujoco")
    text = HEAD.replace("six.urdf", "six.urdf, armatures: true, base_parameters: true")
    text += "parameters: {damping_j1: {value: 7, spread: 0.5}, ratio: 2}\ncolumns: {q_j1: angle}\n"
    model = PhysicsModel.from_yaml(written(text + 'outputs: {q_j1: "ratio*q_j1", q_j2: q_j2}\n'))
    assert model.parameters["damping_j1"].value == 7
    assert {"ratio", "armature_j2", "moment_x_j2", "damping_j2"} <= set(model.parameters)
    assert (model.columns["q_j1"], list(model.ports)) == ("angle", ["j1", "j2"])
    assert str(model.outputs["q_j1"]) == "q_j1*ratio"


def test_a_parameter_that_nothing_uses_is_warned_of(written):
    pytest.importorskip("mujoco")
    with pytest.warns(ModelWarning, match="no equation uses it"):
        PhysicsModel.from_yaml(written(HEAD + "parameters: {dampin_j1: 7}\n"))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (HEAD + "inputs: {tau_j1: N mm}\n", "3:10: inputs.tau_j1: expected what six.urdf has, N m"),
        (
            HEAD + "states: {q_j9: rad}\n",
            "3:10: states.q_j9: .* one of q_j1, q_j2, .* Remedy: leave",
        ),
        (HEAD + "ports: {j1: {flow: w_j2}}\n", "3:9: ports.j1: expected what six.urdf has"),
        (HEAD.replace(".urdf", ".sdf"), "ends in .urdf, .xml, .mjcf, got 'six.sdf'"),
        (HEAD.replace("six", "five"), "2:9: .*five.urdf: expected a URDF file, got: No such file"),
        (
            HEAD.replace("six.urdf", "six.urdf, controls: true"),
            "robot.controls: expected one of payload, .* got this",
        ),
    ],
)
def test_what_a_robot_does_not_have_is_refused_in_its_line(written, text, said):
    pytest.importorskip("mujoco")
    with pytest.raises(ModelError, match=f"model.yaml:{'' if said[0].isdigit() else '.*'}{said}"):
        PhysicsModel.from_yaml(written(text))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("robot: {payload: l2}\n", "1:1: robot: expected the key 'file', got none"),
        ("robot: {file: six.urdf, colour: red}\n", "unknown key 'colour'; expected file, payload"),
        (HEAD + 'equations: {q: "1"}\n', "3:1: expected no 'equations' beside 'robot'"),
        ("robot: {file: six.urdf, armatures: 3}\n", "armatures: expected true or false, got '3'"),
    ],
)
def test_what_is_no_such_section_is_refused_before_the_robot_is_read(written, text, said):
    with pytest.raises(ModelError, match=said):
        PhysicsModel.from_yaml(written(text))


def test_without_mujoco_it_is_said_how_to_install_it(written, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(ModuleNotFoundError, match=r"needs mujoco.*sklearn-pgnn\[robots\]"):
        PhysicsModel.from_yaml(written(HEAD))


def test_a_robots_file_is_named_from_the_folder_of_the_model_file(tmp_path):
    assert relative_to(tmp_path / "a" / "six.urdf", tmp_path / "model.yaml") == "a/six.urdf"
    assert relative_to(tmp_path / "six.urdf", tmp_path / "b" / "model.yaml") == "../six.urdf"
