"""Completion by the shell: files where a file is meant, effects where effects are."""

import pytest
from click.testing import CliRunner

from sklearn_pgnn.cli import main
from sklearn_pgnn.cli.options import SHELLS, completion_script
from sklearn_pgnn.physics.effects import CATALOGUE

pytestmark = pytest.mark.core


def completed(*words):
    """Return what bash is told to complete the last word with: kinds and values."""
    told = {"COMP_WORDS": " ".join(["sklearn-pgnn", *words]), "COMP_CWORD": str(len(words))}
    told["_SKLEARN_PGNN_COMPLETE"] = "bash_complete"
    result = CliRunner().invoke(main, [], env=told, prog_name="sklearn-pgnn")
    return [tuple(line.split(",", 1)) for line in result.stdout.splitlines()]


def test_commands_are_completed():
    assert ("plain", "diagnose") in completed("dia")


def test_files_are_completed_where_files_are_meant():
    assert completed("diagnose", "rec") == [("file", "rec")]
    assert completed("diagnose", "--model", "mod") == [("file", "mod")]


def test_effects_are_completed_after_a_comma_too():
    assert len(completed("diagnose", "--catalogue", "")) == len(CATALOGUE)
    assert completed("diagnose", "--exclude", "leak,cog") == [("plain", "leak,cogging")]


@pytest.mark.parametrize("shell", SHELLS)
def test_the_script_is_one_of_the_shell_asked_for(shell):
    said = CliRunner().invoke(main, ["completion", shell]).stdout
    assert "_SKLEARN_PGNN_COMPLETE" in said
    assert said.strip() == completion_script(main, shell).strip()
