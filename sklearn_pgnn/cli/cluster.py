"""Work spread over a cluster."""

from collections.abc import Iterator
from contextlib import contextmanager

from joblib import parallel_config

from sklearn_pgnn.extras import needed_by


@contextmanager
def on_cluster(address: str | None) -> Iterator[None]:
    """Let joblib spread its work over a cluster of Dask."""
    if address is None:
        yield
        return
    with needed_by("--cluster"):
        from distributed import Client
    with Client(address), parallel_config("dask"):
        yield
