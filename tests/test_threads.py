"""One place decides about threads: each of many small problems runs on one."""

import sys
import threading

import joblib
import numpy as np
import pytest
from far_cluster import FarCluster
from threadpoolctl import threadpool_info, threadpool_limits

from sklearn_pgnn.threads import local_threads, one_thread_each

pytestmark = pytest.mark.core


def threads():
    """Return how many threads the libraries may use that are loaded."""
    return {library["filepath"]: library["num_threads"] for library in threadpool_info()}


def test_libraries_have_one_thread_inside_and_their_own_again_behind():
    np.linalg.norm(np.eye(2) @ np.eye(2))
    before = threads()
    with one_thread_each():
        assert set(threads().values()) <= {1}
    assert threads() == before


def test_an_error_gives_the_threads_back():
    before = threads()
    with pytest.raises(ValueError, match="lost"), one_thread_each():
        raise ValueError("lost")
    assert threads() == before


def test_a_function_may_be_kept_to_one_thread():
    assert set(one_thread_each()(threads)().values()) <= {1}


@pytest.fixture
def two_threads():
    """Let BLAS have two threads, as on a computer with more cores."""
    np.linalg.norm(np.eye(2) @ np.eye(2))
    with threadpool_limits(2, user_api="blas"):
        if 2 not in blas_threads():
            pytest.skip("a BLAS that has one thread only")
        yield


def blas_threads():
    """Return how many threads the libraries of linear algebra may use."""
    return {lib["num_threads"] for lib in threadpool_info() if lib["user_api"] == "blas"}


def in_turn(first, second):
    """Let two threads hold one thread each: the first comes, the second, the first goes, then it.

    Return what was seen while the second was alone.
    """
    came, gone, seen = threading.Event(), threading.Event(), []

    def hold_second():
        with second:
            came.set()
            gone.wait(60)
            seen.append(blas_threads())

    worker = threading.Thread(target=hold_second)
    with first:
        worker.start()
        came.wait(60)
    gone.set()
    worker.join()
    return seen[0]


def test_of_overlapping_holders_the_last_gives_the_threads_back(two_threads):
    before = blas_threads()
    assert in_turn(one_thread_each(), one_thread_each()) == {1}
    assert blas_threads() == before


def test_torch_gets_its_threads_back_when_the_last_holder_has_left(monkeypatch):
    class Torch:
        threads = 4

        def get_num_threads(self):
            return self.threads

        def set_num_threads(self, threads):
            self.threads = threads

    torch = Torch()
    monkeypatch.setitem(sys.modules, "torch", torch)
    with one_thread_each() as had, one_thread_each() as had_inside:
        assert (had, had_inside, torch.threads) == (4, 4, 1)
    assert torch.threads == 4
    in_turn(one_thread_each(), one_thread_each())
    assert torch.threads == 4


@pytest.mark.parametrize("backend", ["threading", "loky"])
def test_a_configuration_on_this_computer_counts_where_no_number_is_given(backend):
    assert local_threads(None) == 1
    with joblib.parallel_config(backend=backend, n_jobs=3):
        assert (local_threads(None), local_threads(2)) == (3, 2)
        assert local_threads(-1) == joblib.cpu_count()


def test_the_cores_of_a_cluster_are_no_threads_of_this_computer():
    with joblib.parallel_config(backend=FarCluster()):
        assert joblib.effective_n_jobs(-1) == 10_000
        assert (local_threads(None), local_threads(3)) == (1, 3)
        assert local_threads(-1) == joblib.cpu_count()
