"""The files that commands write: complete or not at all, and overwriting only on request."""

import os
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from sklearn_pgnn import __version__
from sklearn_pgnn.annotations import FilePath
from sklearn_pgnn.cli.ending import held
from sklearn_pgnn.cli.guard import writing
from sklearn_pgnn.exceptions import OptionError
from sklearn_pgnn.inspection.result_files import as_strict_json
from sklearn_pgnn.whole_file import WorkingFolder, remove_leftovers, write_whole

if TYPE_CHECKING:
    from sklearn_pgnn.diagnosis import ModelDiagnosis


def strict_json(diagnosis: "ModelDiagnosis") -> str:
    """Return a diagnosis as strict JSON with the package's version; null for non-finite values."""
    return as_strict_json({**diagnosis.to_dict(), "version": __version__})


# -- one file --------------------------------------------------------------------------------------


def refuse_existing(path: FilePath, *, force: bool) -> None:
    """Refuse to replace a file, unless requested, and to write to a missing folder."""
    if not Path(path).absolute().parent.is_dir():
        raise OptionError(f"{path}: expected its folder to exist. Remedy: create it first.")
    if Path(path).is_dir():
        raise OptionError(f"{path}: expected a file, got a folder. Remedy: another name.")
    if os.path.lexists(path) and not force:
        raise OptionError(
            f"{path}: expected a new file, got an existing one. Remedy: another name, or --force "
            f"to replace it."
        )


def write_file(path: FilePath, text: str, *, force: bool) -> None:
    """Write a file completely or not at all; only with `force` one is replaced."""
    refuse_existing(path, force=force)
    with held(), writing(path):
        remove_leftovers(Path(path).absolute().parent)
        write_whole(Path(path), text)


# -- several files ---------------------------------------------------------------------------------


def write_files(folder: Path, texts: Mapping[str, Callable[[], str]]) -> dict[str, Exception]:
    """Write the files; one whose text cannot be created does not stop the others."""
    failed = {}
    for name, make in texts.items():
        try:
            text = make()
        except Exception as error:
            failed[name] = error
        else:
            with writing(folder / name):
                (folder / name).write_text(text, encoding="utf-8", errors="replace")
    return failed


def check_free(output: Path, names: Sequence[str], *, force: bool) -> list[str]:
    """Refuse to replace files, unless that is wanted."""
    folders = [name for name in names if (output / name).is_dir()]
    if folders:
        raise OptionError(
            f"--output: {output}: expected no folder of the name {folders[0]}, which is a file of "
            f"the result. Remedy: another folder for the results."
        )
    there = [name for name in names if os.path.lexists(output / name)]
    if there and not force:
        raise OptionError(
            f"--output: {output}: expected no earlier result, got {', '.join(there)}. "
            f"Remedy: another folder, or --force to replace it."
        )
    return there


@contextmanager
def result_folder(output: Path) -> Iterator[Path]:
    """Yield a temporary folder beside `output`, whose files are moved there on success."""
    _check_place(output)
    with held(), writing(output):
        temporary = WorkingFolder(_beside(output))
    try:
        yield temporary.path
        with held(), writing(output):
            for file in sorted(temporary.path.iterdir()):
                output.mkdir(parents=True, exist_ok=True)
                _move(file, output / file.name)
    finally:
        with held():
            temporary.remove()


def remove_files(output: Path, names: Iterable[str]) -> None:
    """Remove the files of an earlier result that a new one has not written again."""
    with held(), writing(output):
        for name in names:
            (output / name).unlink(missing_ok=True)


def _check_place(output: Path) -> None:
    if output.is_symlink() and not output.exists():
        raise OptionError(
            f"--output: {output}: expected a folder for the results, got a link to nothing. "
            f"Remedy: remove the link, or another name."
        )
    if output.exists() and not output.is_dir():
        raise OptionError(f"--output: {output}: expected a folder for the results, got a file.")
    place = _beside(output)
    if not place.is_dir() or not os.access(place, os.W_OK):
        raise OptionError(f"--output: {output}: cannot be written to.")


def _beside(output: Path) -> Path:
    """Return the output itself if it exists, else the nearest folder above it that does."""
    return next(p for p in (output.absolute(), *output.absolute().parents) if p.exists())


def _move(file: Path, target: Path) -> None:
    try:
        os.replace(file, target)
    except OSError:  # another file system, or a folder of that name
        shutil.copyfile(file, target)
