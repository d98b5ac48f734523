"""Options are completed by the shell, and stated in a report as they were given."""

import shlex

import click
import pytest
from click.testing import CliRunner

from sklearn_pgnn.cli import main
from sklearn_pgnn.cli.diagnose import command_line
from sklearn_pgnn.cli.options import SHELLS, completion_script
from sklearn_pgnn.physics.effects import CATALOGUE

pytestmark = pytest.mark.core


def completed(*words):
    """Return what bash is told to complete the last word with: kinds and values."""
    told = {"COMP_WORDS": " ".join(["sklearn-pgnn", *words]), "COMP_CWORD": str(len(words))}
    told["_SKLEARN_PGNN_COMPLETE"] = "bash_complete"
    result = CliRunner().invoke(main, [], env=told, prog_name="sklearn-pgnn")
    return [tuple(line.split(",", 1)) for line in result.stdout.splitlines()]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("dia",), ("plain", "diagnose")),
        (("diagnose", "rec"), ("file", "rec")),
        (("diagnose", "--model", "mod"), ("file", "mod")),
        (("diagnose", "--exclude", "leak,cog"), ("plain", "leak,cogging")),
    ],
)
def test_commands_files_and_effects_are_completed(words, told):
    assert completed(*words) == [told]
    assert len(completed("diagnose", "--catalogue", "")) == len(CATALOGUE)


@pytest.mark.parametrize("shell", SHELLS)
def test_the_script_is_one_of_the_shell_asked_for(shell):
    said = CliRunner().invoke(main, ["completion", shell]).stdout
    assert "_SKLEARN_PGNN_COMPLETE" in said
    assert said.strip() == completion_script(main, shell).strip()


@click.command()
@click.argument("data", nargs=-1)
@click.option("--noise", multiple=True)
@click.option("-f", "--force", is_flag=True)
@click.option("--window", type=float)
def tool(**_):
    click.echo(command_line())


@pytest.mark.parametrize(
    "words",
    [
        ["run 1.csv", "run 2.csv"],
        ["a.csv", "--noise", "v=0.1", "--noise", "x=2", "--force", "--window", "2.0"],
    ],
)
def test_what_was_given_is_what_is_stated(words):
    said = CliRunner().invoke(tool, words).output.strip()
    assert sorted(shlex.split(said)) == sorted(["tool", *words])
    again = CliRunner().invoke(tool, shlex.split(said)[1:]).output.strip()
    assert again == said


def test_outside_of_a_command_there_is_none():
    assert command_line() == ""
