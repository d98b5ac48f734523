"""Optional libraries, and the extras that install them."""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec

EXTRAS = {
    "app": ("starlette", "uvicorn"),
    "benchmarks": ("nonlinear_benchmarks",),
    "control": ("control",),
    "dask": ("distributed",),
    "export": ("casadi", "onnx"),
    "files": ("h5py", "nptdms", "openpyxl", "pyarrow"),
    "fmu": ("fmpy",),
    "mdf": ("asammdf",),
    "network": ("skorch", "torch"),
    "robots": ("mujoco",),
    "ros": ("rosbags",),
    "sindy": ("pysindy",),
    "tuning": ("skopt",),
}
EXTRA_OF = {library: extra for extra, libraries in EXTRAS.items() for library in libraries}


def is_installed(extra: str) -> bool:
    """Return whether the libraries of an extra are installed, without importing them."""
    return all(find_spec(library) is not None for library in EXTRAS[extra])


@contextmanager
def needed_by(what: str) -> Iterator[None]:
    """Name the required extra if an import inside the block does not find a library."""
    try:
        yield
    except ModuleNotFoundError as error:
        if error.name not in EXTRA_OF:
            raise
        raise ModuleNotFoundError(
            f"{what} needs {error.name}, which is not installed. Remedy: "
            f'pip install "sklearn-pgnn[{EXTRA_OF[error.name]}]".',
            name=error.name,
        ) from error
