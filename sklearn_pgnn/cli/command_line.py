"""The command line as given, for a report."""

import shlex

import click
from click.core import ParameterSource


def command_line() -> str:
    """Return the running command with its arguments; empty outside a command."""
    context = click.get_current_context(silent=True)
    if context is None:
        return ""
    words = context.command_path.split()
    for parameter in context.command.params:
        name = parameter.name
        if name and context.get_parameter_source(name) is ParameterSource.COMMANDLINE:
            words += _words(parameter, context.params[name])
    return shlex.join(words)


def _words(parameter: click.Parameter, value) -> list[str]:
    values = list(value) if isinstance(value, tuple) else [value]
    if isinstance(parameter, click.Argument):
        return [str(each) for each in values]
    option = parameter.opts[-1]
    if getattr(parameter, "is_flag", False):
        return [option] if value else []
    return [word for each in values for word in (option, str(each))]
