"""A robot's description stands in place of a model file."""

import sys

import pytest
from click.testing import CliRunner
from robots import moved_records, six_axes

from sklearn_pgnn import PhysicsModel
from sklearn_pgnn.cli import main
from sklearn_pgnn.priors import from_mjcf, from_urdf

mujoco = pytest.importorskip("mujoco")


def call(*words, code=0):
    result = CliRunner().invoke(main, [*map(str, words)])
    assert result.exit_code == code, result.output
    return result.output


def moved(joints, **options):
    """Return records of an arm, and what MuJoCo is told of its joints apart from the model."""
    told = {name: options.pop(name) for name in ("friction", "damping") if name in options}
    m = mujoco.MjModel.from_xml_string(six_axes(joints, **told))
    return moved_records(m, [f"j{k + 1}" for k in range(joints)], **{"samples": 300, **options})


@pytest.mark.slow
def test_check_tells_the_joint_at_which_a_torque_is_missing(tmp_path):
    (tmp_path / "arm.urdf").write_text(six_axes(2))
    moved(2, friction=(0.0, 9.0), records=1).to_csv(tmp_path / "run.csv", index=False)
    output = call("check", "--model", tmp_path / "arm.urdf", tmp_path / "run.csv")
    said = output[output.index("Missing at the joints") :]
    rows = {line.split()[0]: line for line in said.splitlines() if line.strip().startswith("j")}
    assert set(rows) == {"j1", "j2"}
    assert "9" in rows["j2"].split()[1][:3] or "8" in rows["j2"].split()[1][:3]
    assert int(rows["j2"].split("%")[0].split()[-1]) > 70
    assert int(rows["j1"].split("%")[0].split()[-1]) < 20


@pytest.mark.slow
@pytest.mark.parametrize("model", ["arm.urdf", "model.yaml"])
def test_a_diagnosis_writes_what_was_found_into_a_copy(tmp_path, model):
    (tmp_path / "arm.urdf").write_text(six_axes(1))
    (tmp_path / "model.yaml").write_text("robot: {file: arm.urdf}\n")
    records = moved(1, friction=(1.0,), records=3, noise=5e-4)
    records.to_csv(tmp_path / "runs.csv", index=False)
    asked = ("diagnose", "--model", tmp_path / model, tmp_path / "runs.csv", "--jobs", "1")
    effects = ("--catalogue", "coulomb_friction,linear_stiffness")
    assert "Coulomb friction" in call(*asked, *effects, "--output", tmp_path / "out")
    found = mujoco.MjModel.from_xml_path(str(tmp_path / "out" / "extended_model.urdf"))
    assert found.dof_frictionloss[0] == pytest.approx(1.0, rel=0.15)
    assert found.dof_damping[0] == pytest.approx(2.0, rel=0.15)


def test_a_file_that_is_none_is_refused_in_one_line(tmp_path):
    (tmp_path / "arm.urdf").write_text("<sdf/>")
    (tmp_path / "run.csv").write_text("t,tau\n0,1\n")
    said = call("check", "--model", tmp_path / "arm.urdf", tmp_path / "run.csv", code=2)
    assert "expected a URDF file, <robot>, got <sdf>" in said


def test_init_writes_a_model_file_of_a_robot(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.urdf").write_text(six_axes(2))
    moved(2, records=1).to_csv(tmp_path / "run.csv", index=False)
    said = call("init", "arm.urdf", "--records", "run.csv")
    assert "sklearn-pgnn check --model model.yaml run.csv" in said
    text = (tmp_path / "model.yaml").read_text()
    assert "\nrobot: {file: arm.urdf}\n" in text
    assert "# The columns of your file: trajectory, t, q_j1, q_j2, tau_j1, tau_j2." in text
    assert "\ninputs: {tau_j1: N m, tau_j2: N m}\n" in text
    assert "\noutputs: {q_j1: q_j1, q_j2: q_j2}\n" in text
    assert '\n  j2: {effort: tau_j2, flow: w_j2, displacement: q_j2, unit: "N m"}\n' in text
    assert PhysicsModel.from_yaml(tmp_path / "model.yaml") == from_urdf(tmp_path / "arm.urdf")
    assert "Missing at the joints" in call("check", "--model", "model.yaml", "run.csv")


PENDULUM = """<mujoco><worldbody><body><joint name="j" axis="0 1 0" damping="0.3"/>
<inertial pos="0.3 0 0" mass="2" diaginertia="0.1 0.2 0.3"/></body></worldbody>
<actuator><motor name="drive" joint="j" gear="30"/></actuator></mujoco>"""


@pytest.mark.filterwarnings("error")
def test_init_takes_mjcf_in_place_of_records(tmp_path):
    (tmp_path / "robot.xml").write_text(PENDULUM)
    (tmp_path / "models").mkdir()
    path = tmp_path / "models" / "mine.yaml"
    asked = ("init", path, "--records", tmp_path / "robot.xml")
    call(*asked)
    assert "robot: {file: ../robot.xml}" in path.read_text()
    assert PhysicsModel.from_yaml(path) == from_mjcf(tmp_path / "robot.xml")
    assert "expected a new file, got an existing one" in call(*asked, code=2)


def test_a_fit_writes_a_model_file_that_names_the_description(tmp_path):
    moved(1, damping=(5.0,), records=1).to_csv(tmp_path / "run.csv", index=False)
    (tmp_path / "arm.urdf").write_text(six_axes(1))
    source, fitted = tmp_path / "model.yaml", tmp_path / "fitted.yaml"
    source.write_text("robot: {file: arm.urdf, armatures: true}\ncolumns: {q_j1: q_j1}\n")
    call("fit", "--model", source, tmp_path / "run.csv", "--output", fitted)
    found = PhysicsModel.from_yaml(fitted)
    assert found.parameters["damping_j1"].value == pytest.approx(5.0, rel=0.02)
    assert "robot: {file: arm.urdf, armatures: true}" in fitted.read_text()


def test_init_without_mujoco_names_the_extra(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "mujoco", None)
    (tmp_path / "arm.urdf").write_text(six_axes(1))
    result = CliRunner().invoke(main, ["init", "arm.urdf"])
    assert result.exit_code != 0
    assert 'pip install "sklearn-pgnn[robots]"' in result.output
    assert not (tmp_path / "model.yaml").exists()
