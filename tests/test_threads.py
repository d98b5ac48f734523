"""One place decides about threads: each of many small problems runs on one."""

import numpy as np
import pytest
from threadpoolctl import threadpool_info

from sklearn_pgnn.threads import one_thread_each

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
