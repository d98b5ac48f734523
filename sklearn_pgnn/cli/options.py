"""The options of the commands, how a shell completes them, and the ready systems."""

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


#: plain descriptions by name; each system is made by a function of `sklearn_pgnn.systems`
SYSTEMS = {
    "cart-on-spring": "Cart on a spring",
    "golf-robot": "Golf robot (driven pendulum)",
    "servo-valve": "Servo valve",
    "two-tanks": "Two tanks",
}


def make_system(name: str):
    """Return a ready system.

    Its name is a key of `SYSTEMS`.
    """
    from sklearn_pgnn import systems  # loads sympy, which most commands' help does without

    return getattr(systems, name.replace("-", "_"))()


def _not_none(_context, _option, value: int) -> int:
    if value == 0:
        raise click.BadParameter("expected 1 or more, or -1 for all cores.")
    return value


def _jobs(help: str):
    return click.option(
        "--jobs",
        "n_jobs",
        default=-1,
        show_default="all cores",
        callback=_not_none,
        help=help,
    )


_MODEL = click.option(
    "--model",
    required=True,
    metavar="MODEL.yaml",
    type=FILE,
    help="The model file, or an FMU for model exchange.",
)
_SHARE = click.FloatRange(min=0, max=1, min_open=True, max_open=True)
_CORES = _jobs("Number of threads, and of processes where they save time.")
_PROCESSES = _jobs("Processes to use, each for a machine at a time; a --cluster uses all it has.")
_TALK = (
    click.option("--quiet", is_flag=True, help="Print a short summary, and no progress."),
    click.option("--debug", is_flag=True, help="Show the traceback of an error as well."),
)
_FORCE = click.option("--force", is_flag=True, help="Replace existing files.")
_JSON = click.option("--json", "as_json", is_flag=True, help="Print JSON only.")
_SHOW = (
    _JSON,
    click.option("--open", "opens", is_flag=True, help="Open the report when it is written."),
)
_SAMPLE_TIME = click.option(
    "--sample-time",
    type=click.FloatRange(min=0, min_open=True),
    metavar="S",
    help="Time from sample to sample [s], for files without a time; it overrides one they have.",
)
_NOISE = click.option(
    "--noise",
    multiple=True,
    metavar="[OUTPUT=]SD",
    help="Standard deviation of an output's noise, in the output's unit: a number, or "
    "OUTPUT=NUMBER for each of several outputs; by default estimated from the records.",
)
_HOLD = click.option(
    "--hold",
    type=click.Choice(["auto", "zoh", "foh"]),
    default="auto",
    show_default=True,
    help=(
        "Inputs are held (zoh) or linearly interpolated (foh) between samples; auto: as the model "
        "file says, else held, unless the records contradict it."
    ),
)
_SUBSTEPS = click.option(
    "--substeps",
    type=click.IntRange(min=1, max=10_000),
    metavar="N",
    help="Integration steps from sample to sample; by default as the model file says, else as "
    "many as accuracy needs.",
)
_WINDOW = click.option(
    "--window",
    "window_length",
    type=click.FloatRange(min=0, min_open=True),
    metavar="S",
    help="Window length [s]: how long the model is simulated before it is re-initialised; "
    "by default chosen from the records.",
)
_CATALOGUE = click.option(
    "--catalogue",
    multiple=True,
    shell_complete=complete_effects,
    metavar="EFFECTS",
    help=(
        "Consider only these effects: ids, separated by commas, as in coulomb_friction,input_bias. "
        "By default all; --list-effects names them."
    ),
)
_EXCLUDE = click.option(
    "--exclude",
    multiple=True,
    shell_complete=complete_effects,
    metavar="EFFECTS",
    help="Leave out these effects: those the machine is known not to have.",
)
_TARGETS = click.option(
    "--targets",
    multiple=True,
    metavar="NAMES",
    help=(
        "Consider only these states, ports, inputs, outputs and parameters of the model, separated "
        "by commas; by default all."
    ),
)
_SEED = click.option(
    "--seed",
    "random_state",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="Random seed.",
)
_SAID_HOLD = click.option(
    "--hold",
    type=click.Choice(["zoh", "foh"]),
    help=(
        "Inputs are held (zoh) or linearly interpolated (foh) between samples; by default as the "
        "model file says, else held."
    ),
)
_CANDIDATES = (_CATALOGUE, _EXCLUDE, _TARGETS)
_DIAGNOSIS = (
    _NOISE,
    _HOLD,
    _SUBSTEPS,
    _WINDOW,
    *_CANDIDATES,
    click.option(
        "--max-causes",
        type=click.IntRange(min=1),
        default=4,
        show_default=True,
        help="Causes named at most.",
    ),
    click.option(
        "--alpha",
        type=_SHARE,
        default=0.01,
        show_default=True,
        metavar="RATE",
        help="False-alarm rate: the probability that a cause is named although nothing is missing.",
    ),
    click.option(
        "--smallest-share",
        type=_SHARE,
        default=0.05,
        show_default=True,
        metavar="SHARE",
        help="Smallest share of an output's error power that matters.",
    ),
    click.option(
        "--time-limit",
        type=click.FloatRange(min=0, min_open=True),
        metavar="S",
        help=(
            "Time [s] for everything but the report's pages. A search that does not finish reports "
            "the best so far, as provisional."
        ),
    ),
    _SEED,
)


def job_options(command):
    """Add the options that control how a command runs: threads, output and debugging."""
    return _with(command, (_CORES, *_TALK))


def fleet_options(command):
    """Add the options that control how a fleet is diagnosed: processes, output and debugging."""
    return _with(command, (_PROCESSES, *_TALK))


def show_options(command):
    """Add the options that say what becomes of results: print, open."""
    return _with(command, _SHOW)


def result_options(command):
    """Add the options that say what becomes of a diagnosis: replace, print, open."""
    return _with(command, (_FORCE, *_SHOW))


def quiet_options(command):
    """Add the options that control how much a command prints."""
    return _with(command, _TALK)


def json_option(command):
    """Add the option that prints JSON in place of words."""
    return _with(command, (_JSON,))


def force_option(command):
    """Add the option that allows a command to replace a file."""
    return _with(command, (_FORCE,))


def model_option(command):
    """Add the model file."""
    return _with(command, (_MODEL,))


def sample_time_option(command):
    """Add the time from sample to sample of files that have none."""
    return _with(command, (_SAMPLE_TIME,))


def records_arguments(command):
    """Add the model file and the files of records."""
    data = click.argument("data", nargs=-1, required=True, metavar="DATA [DATA ...]", type=FILE)
    return _with(command, (data, _MODEL, _SAMPLE_TIME))


def fit_options(command):
    """Add the options of a fit."""
    return _with(command, (_NOISE, _SAID_HOLD, _SUBSTEPS, _WINDOW, _SEED))


def detect_options(command):
    """Add the options of a detectability."""
    return _with(command, (_NOISE, _HOLD, _SUBSTEPS, _WINDOW, *_CANDIDATES, _SEED))


def diagnosis_options(command):
    """Add the options of a diagnosis to a command."""
    return _with(command, _DIAGNOSIS)


def list_effects(command):
    """Add the option that lists the catalogue of effects and exits."""
    return click.option(
        "--list-effects",
        is_flag=True,
        is_eager=True,
        expose_value=False,
        callback=_list_effects,
        help="List the effects that a diagnosis considers, and exit.",
    )(command)


def _list_effects(context, _option, wanted: bool) -> None:
    if not wanted or context.resilient_parsing:
        return
    from sklearn_pgnn.physics.effects import CATALOGUE

    width = max(len(effect.id) for effect in CATALOGUE)
    for effect in CATALOGUE:
        click.echo(f"{effect.id:{width}}  {effect.summary}")
    context.exit()


def _with(command, options):
    for option in reversed(options):
        command = option(command)
    return command
