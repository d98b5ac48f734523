"""Completion of the command line by the shell: scripts, files and the names of effects."""

import click
from click.shell_completion import get_completion_class

PROGRAM = "sklearn-pgnn"
SHELLS = ("bash", "zsh", "fish")


class _File(click.Path):
    def convert(self, value, param, ctx):
        if not value:
            self.fail("expected the name of a file or a folder, got an empty text.", param, ctx)
        return super().convert(value, param, ctx)


#: a path that the shell completes; existence and content of the file are checked later
FILE = _File()


def complete_effects(_context, _option, begun: str) -> list[str]:
    """Return the possible completions of a comma-separated list of effects.

    Examples
    --------
    >>> complete_effects(None, None, "leak,input_bi")
    ['leak,input_bias']
    """
    from sklearn_pgnn.physics.effects import CATALOGUE

    before, comma, last = begun.rpartition(",")
    return [f"{before}{comma}{e.id}" for e in CATALOGUE if e.id.startswith(last)]


def completion_script(command: click.Command, shell: str) -> str:
    """Return the script that makes a shell complete the command line."""
    variable = f"_{PROGRAM.replace('-', '_').upper()}_COMPLETE"
    kind = get_completion_class(shell)
    assert kind is not None
    return kind(command, {}, PROGRAM, variable).source()
