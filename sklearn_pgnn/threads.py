"""The single place that decides on the use of threads.

This package computes many small problems. They run in parallel, by joblib or on the threads of the
simulation, each of them on one thread: BLAS, OpenMP and torch would otherwise start as many threads
again, which wait for each other.
"""

import multiprocessing
import os
import sys
import threading
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from functools import cache, lru_cache
from typing import Any

from joblib import Parallel, effective_n_jobs, parallel_config
from joblib.parallel import (
    LokyBackend,
    MultiprocessingBackend,
    SequentialBackend,
    ThreadingBackend,
    get_active_backend,
)
from threadpoolctl import OpenBLASController, ThreadpoolController

#: the backends of joblib that count the cores of this computer; others may count a cluster's
LOCAL = (SequentialBackend, ThreadingBackend, LokyBackend, MultiprocessingBackend)

# -- how many threads ------------------------------------------------------------------------------


def local_threads(n_jobs: int | None) -> int:
    """Return the number of threads on this computer for a given `n_jobs`."""
    backend, _ = get_active_backend()
    if type(backend) in LOCAL:
        return effective_n_jobs(n_jobs)
    with parallel_config(backend="threading", n_jobs=1):
        return effective_n_jobs(n_jobs)


def other_processes(n_jobs: int | None) -> int:
    """Return the number of processes for a given `n_jobs`, on this computer or in a cluster.

    >>> other_processes(None), other_processes(2)
    (1, 2)
    >>> with parallel_config(backend="threading"):
    ...     other_processes(2)
    1
    """
    backend, _ = get_active_backend()
    if backend.nesting_level or isinstance(backend, (SequentialBackend, ThreadingBackend)):
        return 1
    return effective_n_jobs(n_jobs)


def in_turn(calls: list, n_jobs: int | None, **options: Any) -> Iterable[Any]:
    """Return the results of `joblib.delayed` calls in order, each as soon as joblib returns it."""
    try:
        parallel = Parallel(n_jobs, return_as="generator", **options)
    except ValueError:  # the backend returns all results at once
        parallel = Parallel(n_jobs, **options)
    return parallel(calls)


@lru_cache(maxsize=8)
def kept_pool(threads: int) -> ThreadPoolExecutor:
    """Return the pool of given size, one per process; its tasks must not wait for the pool."""
    return ThreadPoolExecutor(threads)


# -- other processes that nobody needs -------------------------------------------------------------


def end_with_parent() -> None:
    """Let a process of joblib end when the one that it works for is gone; others are left alone."""
    if type(multiprocessing.current_process()).__name__ == "LokyProcess":
        _watched(os.getppid())


@cache
def _watched(parent: int) -> threading.Thread:
    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1.0)
        os._exit(1)

    thread = threading.Thread(target=watch, daemon=True)
    thread.start()
    return thread


# -- one thread each -------------------------------------------------------------------------------


class _Process:
    """Process-wide thread limits: one thread until the last caller that asked for it has left."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.holders = 0
        self.torch_threads: int | None = None
        self.limits = ExitStack()

    def ask_torch(self) -> None:
        """Record the threads of torch once it is loaded, before it is limited to one."""
        torch = sys.modules.get("torch")
        if torch and self.torch_threads is None:
            self.torch_threads = torch.get_num_threads()

    def enter(self, blas: ThreadpoolController) -> int:
        """Limit BLAS and torch to one thread; return how many torch had."""
        self.holders += 1
        if any(library["num_threads"] > 1 for library in blas.info()):
            self.limits.callback(blas.limit(limits=1).restore_original_limits)
            _release()
        if self.torch_threads is None:
            return 1
        sys.modules["torch"].set_num_threads(1)
        return self.torch_threads

    def leave(self) -> None:
        """Restore the threads, unless another caller still needs the limit."""
        self.holders -= 1
        if self.holders:
            return
        self.limits.close()
        _release()
        if self.torch_threads is not None:
            sys.modules["torch"].set_num_threads(self.torch_threads)
        self.torch_threads = None


def _release() -> None:
    """Let any thread set those of OpenBLAS, which threadpoolctl leaves to the first one."""
    getattr(OpenBLASController, "clear_controlling_thread", lambda: None)()


_PROCESS = _Process()


@contextmanager
def one_thread_each() -> Iterator[int]:
    """Limit BLAS, OpenMP and torch (if loaded) to one thread; usable as a decorator, too.

    OpenMP limits the threads of each caller, BLAS and torch those of the process: the latter are
    restored when the last of several blocks has ended, whichever that is.
    """
    with _PROCESS.lock:
        _PROCESS.ask_torch()
        libraries = ThreadpoolController()
        of_caller = libraries.select(user_api="openmp").limit(limits=1)
        threads = _PROCESS.enter(libraries.select(user_api="blas"))
    try:
        yield threads
    finally:
        with _PROCESS.lock:
            _PROCESS.leave()
            of_caller.restore_original_limits()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(  # a lock that another thread holds would never be released in the child
        before=lambda: _PROCESS.lock.acquire(),
        after_in_parent=lambda: _PROCESS.lock.release(),
        after_in_child=lambda: _PROCESS.lock.release(),
    )
    os.register_at_fork(after_in_child=kept_pool.cache_clear)  # threads do not live on there
