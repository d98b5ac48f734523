"""A robot's description stands in place of a model file."""

import pytest
from click.testing import CliRunner
from robots import moved_records, six_axes

from sklearn_pgnn.cli import main

mujoco = pytest.importorskip("mujoco")


@pytest.mark.slow
def test_check_tells_the_joint_at_which_a_torque_is_missing(tmp_path):
    m = mujoco.MjModel.from_xml_string(six_axes(2, friction=(0.0, 9.0)))
    table = moved_records(m, ["j1", "j2"], records=1, samples=300)
    (tmp_path / "arm.urdf").write_text(six_axes(2))
    table.to_csv(tmp_path / "run.csv", index=False)
    asked = ["check", "--model", str(tmp_path / "arm.urdf"), str(tmp_path / "run.csv")]
    result = CliRunner().invoke(main, asked)
    assert result.exit_code == 0, result.output
    said = result.output[result.output.index("Missing at the joints") :]
    rows = {line.split()[0]: line for line in said.splitlines() if line.strip().startswith("j")}
    assert set(rows) == {"j1", "j2"}
    assert "9" in rows["j2"].split()[1][:3] or "8" in rows["j2"].split()[1][:3]
    assert int(rows["j2"].split("%")[0].split()[-1]) > 70
    assert int(rows["j1"].split("%")[0].split()[-1]) < 20


@pytest.mark.slow
def test_a_diagnosis_writes_what_was_found_into_a_copy(tmp_path):
    m = mujoco.MjModel.from_xml_string(six_axes(1, friction=(1.0,)))
    table = moved_records(m, ["j1"], records=3, samples=300, noise=5e-4)
    (tmp_path / "arm.urdf").write_text(six_axes(1))
    table.to_csv(tmp_path / "runs.csv", index=False)
    asked = ["diagnose", "--model", str(tmp_path / "arm.urdf"), str(tmp_path / "runs.csv")]
    asked += ["--catalogue", "coulomb_friction,linear_stiffness", "--output", str(tmp_path / "out")]
    result = CliRunner().invoke(main, [*asked, "--jobs", "1"])
    assert result.exit_code == 0, result.output
    assert "Coulomb friction" in result.output
    found = mujoco.MjModel.from_xml_path(str(tmp_path / "out" / "extended_model.urdf"))
    assert found.dof_frictionloss[0] == pytest.approx(1.0, rel=0.15)
    assert found.dof_damping[0] == pytest.approx(2.0, rel=0.15)


def test_a_file_that_is_none_is_refused_in_one_line(tmp_path):
    (tmp_path / "arm.urdf").write_text("<sdf/>")
    (tmp_path / "run.csv").write_text("t,tau\n0,1\n")
    asked = ["check", "--model", str(tmp_path / "arm.urdf"), str(tmp_path / "run.csv")]
    result = CliRunner().invoke(main, asked)
    assert result.exit_code == 2
    assert "expected a URDF file, <robot>, got <sdf>" in result.output
