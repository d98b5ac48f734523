"""The command as a report states it."""

import shlex

import click
import pytest
from click.testing import CliRunner

from sklearn_pgnn.cli.diagnose import command_line

pytestmark = pytest.mark.core


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
