"""Where a diagnosis comes from is stated, and the same is written again."""

import copy
import hashlib

import pytest
from situations import situation

from sklearn_pgnn.inspection.report import Provenance, render_report
from sklearn_pgnn.inspection.report.provenance import method

pytestmark = pytest.mark.core


@pytest.fixture
def known(tmp_path):
    paths = [tmp_path / name for name in ("model.yaml", "r-1.csv")]
    for path in paths:
        path.write_text(path.name)
    command = "sklearn-pgnn diagnose -x -1"
    return Provenance.of_files(paths[0], paths[1:], command, date="2026-11-22")


def test_files_hashes_command_and_samples_are_stated(known):
    text = render_report(situation("adequate"), known)
    for name in ("model.yaml", "r-1.csv"):
        assert hashlib.sha256(name.encode()).hexdigest() in text
    for what in ("4 records, 2000 samples", "2026-11-22", "diagnose -x -1", "sklearn-pgnn 0."):
        assert what in text


def test_the_method_says_which_faults_were_left_out_by_what_is_known_of_the_channels():
    found = copy.copy(situation("adequate"))
    assert "that the channels can have" not in method(found)
    (output,) = found.model.outputs
    found.model = found.model.replace(channels={output: "encoder"})
    assert f"can have were tried: {output} is read by an encoder; of " in method(found)


def test_the_same_is_written_again(known):
    diagnosis = situation("adequate")
    assert render_report(diagnosis, known) == render_report(diagnosis, known)


def test_a_file_that_is_not_there_is_said(tmp_path):
    with pytest.raises(OSError, match="nowhere"):
        Provenance.of_files(None, [tmp_path / "nowhere.csv"])
