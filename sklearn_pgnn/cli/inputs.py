"""What a command is given: the model file, the files of records, and options read for a model."""

import math
import re
import warnings
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import NoReturn

import click
import pandas as pd

from sklearn_pgnn.cli.guard import one_line
from sklearn_pgnn.estimation.possible_causes import check_targets, is_possible
from sklearn_pgnn.exceptions import ModelWarning, OptionError, RecordWarning
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.effects import CATALOGUE, by_id
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.priors import from_fmu
from sklearn_pgnn.priors.robot_section import ROBOTS
from sklearn_pgnn.trajectories.files import read_files

#: how files are read that are no model files, by their ending
READERS = {".fmu": from_fmu, **ROBOTS}


def read_model_and_records(
    model: str | PathLike, data: Sequence[str | PathLike], sample_time: float | None
) -> tuple[PhysicsModel, pd.DataFrame, pd.DataFrame]:
    """Read a model file and files of records."""
    read = read_model(model)
    with told_warnings(RecordWarning):
        return read, *read_files(data, read, sample_time)


def read_model(path: str | PathLike) -> PhysicsModel:
    """Read a model file, and print what is doubtful in it."""
    with told_warnings(ModelWarning):
        return open_model(path)


def open_model(path: str | PathLike) -> PhysicsModel:
    """Return the model of a model file, of a functional mock-up unit, or of a robot."""
    return READERS.get(Path(path).suffix.lower(), PhysicsModel.from_yaml)(path)


@contextmanager
def told_warnings(*kinds: type[Warning]) -> Iterator[None]:
    """Print warnings of some categories on one line each, and no others."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("ignore")
        for kind in kinds:
            warnings.simplefilter("always", kind)
        yield
    for warning in told:
        click.echo(f"Warning: {one_line(warning.message)}", err=True)


def read_noise(words: Sequence[str], outputs: Sequence[str]) -> list[float] | None:
    """Read the noise of a model's outputs."""
    if not words:
        return None
    found: dict[str, float] = {}
    for word in words:
        name, equals, number = word.rpartition("=")
        name = name.strip() if equals or len(outputs) > 1 else outputs[0]
        if name not in outputs or name in found:
            _refuse_noise(word, outputs)
        value = positive(number)
        if value is None:
            raise OptionError(
                f"--noise: expected a number > 0 as standard deviation, got {word!r}."
            )
        found[name] = value
    if len(found) < len(outputs):
        _refuse_noise(", ".join(words), outputs)
    return [found[name] for name in outputs]


def positive(text: str) -> float | None:
    """Return a positive number that is written as text; None where that is something else."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if 0 < value < math.inf else None


def _refuse_noise(word: str, outputs: Sequence[str]) -> NoReturn:
    each = " ".join(f"--noise {name}=NUMBER" for name in outputs)
    raise OptionError(f"--noise: expected every output of the model once ({each}), got {word!r}.")


def choose_effects(only: Iterable[str], not_these: Iterable[str]) -> tuple[type[Effect], ...]:
    """Choose effects of the catalogue by their ids.

    >>> [effect.id for effect in choose_effects(["leak,cogging", "overflow"], ["leak"])]
    ['cogging', 'overflow']
    """
    wanted = [by_id(word) for word in split(only)] or CATALOGUE
    unwanted = [by_id(word) for word in split(not_these)]
    chosen = tuple(e for e in CATALOGUE if e in wanted and e not in unwanted)
    if not chosen:
        raise OptionError(
            "--exclude: expected at least one effect to remain, got all of them excluded."
        )
    return chosen


def split(words: Iterable[str]) -> list[str]:
    """Return the words between commas and blanks.

    >>> split(["a, b", "c"])
    ['a', 'b', 'c']
    """
    return [word for text in words for word in re.split(r"[,\s]+", text) if word]


def choose_targets(words: Iterable[str], model: PhysicsModel) -> list[str] | None:
    """Return the quantities of a model that may be targets."""
    names = split(words)
    check_targets(model, names)
    return names or None


def read_search(model: PhysicsModel, options: dict) -> dict:
    """Take the words for noise, effects and targets out of options; return what they mean."""
    noise = read_noise(options.pop("noise", ()), list(model.outputs))
    effects = choose_effects(options.pop("catalogue", ()), options.pop("exclude", ()))
    targets = choose_targets(options.pop("targets", ()), model)
    check_candidates(model, effects, targets)
    return {"noise_std": noise, "catalogue": effects, "targets": targets}


def check_candidates(
    model: PhysicsModel, effects: Sequence[type[Effect]], targets: Collection[str] | None
) -> None:
    """Refuse a choice of effects and targets that leaves no candidate."""
    if not is_possible(model, effects, targets):
        ids = ", ".join(effect.id for effect in effects)
        on = f"on {', '.join(targets)} " if targets else ""
        raise OptionError(
            f"--catalogue, --exclude, --targets: expected at least one candidate to remain, but "
            f"{ids} cannot act {on}in the model {model.name!r}"
            f"{', by what its channels are' if model.channels else ''}."
        )
