"""What the page accepts as a model is whole in one file."""

import pytest

from sklearn_pgnn.exceptions import ModelError

jobs = pytest.importorskip("sklearn_pgnn.cli.app.jobs")


def test_a_model_of_a_robot_in_another_file_is_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    jobs.NEW.write_text("robot: {file: ../arm.urdf}\n")
    said = r"mine.yaml: expected a model that is whole, got one of a robot in '../arm.urdf'. Remedy"
    with pytest.raises(ModelError, match=said):
        jobs.take_model(lambda *_: None, "mine.yaml")
    assert not jobs.MODEL.exists()
