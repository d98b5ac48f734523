"""Who may use threads: one place decides.

What this package computes is many small problems. They run next to each other, by joblib or on the
threads of the simulation, and each of them on one thread: BLAS, OpenMP and torch would start
as many again, which wait for each other.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from threadpoolctl import threadpool_limits


@contextmanager
def one_thread_each() -> Iterator[int]:
    """Keep BLAS, OpenMP and torch, where it is loaded, to one thread; a decorator, too.

    Yields
    ------
    int
        Threads that torch had and gets back, which may be used otherwise meanwhile; 1 without it.

    Examples
    --------
    >>> from threadpoolctl import threadpool_info
    >>> with one_thread_each():
    ...     print({library["num_threads"] for library in threadpool_info()} <= {1})
    True
    """
    torch = sys.modules.get("torch")
    threads = torch.get_num_threads() if torch else 1
    with threadpool_limits(1):
        try:
            if torch:
                torch.set_num_threads(1)
            yield threads
        finally:
            if torch:
                torch.set_num_threads(threads)
