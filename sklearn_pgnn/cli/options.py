"""The options of the commands, how a shell completes them, and the ready systems."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import get_completion_class

if TYPE_CHECKING:
    from sklearn_pgnn.physics.model import PhysicsModel

PROGRAM = "sklearn-pgnn"
#: the model file that `init` writes
MODEL_FILE = "model.yaml"
SHELLS = ("bash", "zsh", "fish")


class _File(click.Path):
    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if not value:
            self.fail("expected the name of a file or a folder, got an empty text.", param, ctx)
        return super().convert(value, param, ctx)


#: a path that the shell completes; existence and content of the file are checked later
FILE = _File()


def complete_effects(_context: click.Context, _option: click.Parameter, begun: str) -> list[str]:
    """Return the possible completions of a comma-separated list of effects.

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


def make_system(name: str) -> "PhysicsModel":
    """Return a ready system by its key in `SYSTEMS`."""
    from sklearn_pgnn import systems  # loads sympy, which most commands' help does without

    return getattr(systems, name.replace("-", "_"))()


def _not_none(_context: click.Context, _option: click.Parameter, value: int) -> int:
    if value == 0:
        raise click.BadParameter("expected 1 or more, or -1 for all cores.")
    return value


def _list_effects(context: click.Context, _option: click.Parameter, wanted: bool) -> None:
    if not wanted or context.resilient_parsing:
        return
    from sklearn_pgnn.physics.effects import CATALOGUE

    width = max(len(effect.id) for effect in CATALOGUE)
    for effect in CATALOGUE:
        click.echo(f"{effect.id:{width}}  {effect.summary}")
    context.exit()


def _jobs(help: str) -> Callable[[Callable], Callable]:
    return click.option(
        "--jobs",
        "n_jobs",
        default=-1,
        show_default="all cores",
        callback=_not_none,
        help=help,
    )


MODEL = click.option(
    "--model",
    required=True,
    metavar="MODEL.yaml",
    type=FILE,
    help="The model file, or an FMU for model exchange.",
)
POSITIVE = click.FloatRange(min=0, min_open=True)
SHARE = click.FloatRange(min=0, max=1, min_open=True, max_open=True)
CORES = _jobs("Number of threads, and of processes where they save time.")
PROCESSES = _jobs("Processes to use, each for a machine at a time; a --cluster uses all it has.")
TALK = (
    click.option("--quiet", is_flag=True, help="Print a short summary, and no progress."),
    click.option("--debug", is_flag=True, help="Show the traceback of an error as well."),
)
FORCE = click.option("--force", is_flag=True, help="Replace existing files.")
JSON = click.option("--json", "as_json", is_flag=True, help="Print JSON only.")
SHOW = (
    JSON,
    click.option("--open", "opens", is_flag=True, help="Open the report when it is written."),
)
#: kinds of files for records with their simulations
RUN_KINDS = ("csv", "parquet", "mcap")
DATA = click.argument("data", nargs=-1, required=True, metavar="DATA [DATA ...]", type=FILE)
SAMPLE_TIME = click.option(
    "--sample-time",
    type=POSITIVE,
    metavar="S",
    help="Time from sample to sample [s], for files without a time; it overrides one they have.",
)
NOISE = click.option(
    "--noise",
    multiple=True,
    metavar="[OUTPUT=]SD",
    help="Standard deviation of an output's noise, in the output's unit: a number, or "
    "OUTPUT=NUMBER for each of several outputs; by default estimated from the records.",
)
HOLD = click.option(
    "--hold",
    type=click.Choice(["auto", "zoh", "foh"]),
    default="auto",
    show_default=True,
    help=(
        "Inputs are held (zoh) or linearly interpolated (foh) between samples; auto: as the model "
        "file says, else held, unless the records contradict it."
    ),
)
SUBSTEPS = click.option(
    "--substeps",
    type=click.IntRange(min=1, max=10_000),
    metavar="N",
    help="Integration steps from sample to sample; by default as the model file says, else as "
    "many as accuracy needs.",
)
WINDOW = click.option(
    "--window",
    "window_length",
    type=POSITIVE,
    metavar="S",
    help="Window length [s]: how long the model is simulated before it is re-initialised; "
    "by default chosen from the records.",
)
ONLY = click.option(
    "--catalogue",
    multiple=True,
    shell_complete=complete_effects,
    metavar="EFFECTS",
    help=(
        "Consider only these effects: ids, separated by commas, as in coulomb_friction,input_bias. "
        "By default all; --list-effects names them."
    ),
)
EXCLUDE = click.option(
    "--exclude",
    multiple=True,
    shell_complete=complete_effects,
    metavar="EFFECTS",
    help="Leave out these effects: those the machine is known not to have.",
)
TARGETS = click.option(
    "--targets",
    multiple=True,
    metavar="NAMES",
    help=(
        "Consider only these states, ports, inputs, outputs and parameters of the model, separated "
        "by commas; by default all."
    ),
)
SEED = click.option(
    "--seed",
    "random_state",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="Random seed.",
)
SAID_HOLD = click.option(
    "--hold",
    type=click.Choice(["zoh", "foh"]),
    help=(
        "Inputs are held (zoh) or linearly interpolated (foh) between samples; by default as the "
        "model file says, else held."
    ),
)
RECORDS = (DATA, MODEL, SAMPLE_TIME)
CANDIDATES = (ONLY, EXCLUDE, TARGETS)
DIAGNOSIS = (
    NOISE,
    HOLD,
    SUBSTEPS,
    WINDOW,
    *CANDIDATES,
    click.option(
        "--max-causes",
        type=click.IntRange(min=1),
        default=4,
        show_default=True,
        help="Causes named at most.",
    ),
    click.option(
        "--alpha",
        type=SHARE,
        default=0.01,
        show_default=True,
        metavar="RATE",
        help="False-alarm rate: the probability that a cause is named although nothing is missing.",
    ),
    click.option(
        "--smallest-share",
        type=SHARE,
        default=0.05,
        show_default=True,
        metavar="SHARE",
        help="Smallest share of an output's error power that matters.",
    ),
    click.option(
        "--time-limit",
        type=POSITIVE,
        metavar="S",
        help=(
            "Time [s] for everything but the report's pages. A search that does not finish reports "
            "the best so far, as provisional."
        ),
    ),
    SEED,
)


LIST_EFFECTS = click.option(
    "--list-effects",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_list_effects,
    help="List the effects that a diagnosis considers, and exit.",
)


def output_option(metavar: str, help: str = "Output file.") -> Callable[[Callable], Callable]:
    """Return the option that says where to write."""
    return click.option("--output", required=True, metavar=metavar, type=FILE, help=help)


def with_options(*options: Callable[[Callable], Callable]) -> Callable[[Callable], Callable]:
    """Return a decorator that adds options to a command, in their order."""

    def decorate(command: Callable) -> Callable:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate
