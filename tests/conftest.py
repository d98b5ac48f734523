"""What several tests share."""

import os
import shutil
from pathlib import Path

import hypothesis
import pytest

# the same examples every time, however slow the machine is
hypothesis.settings.register_profile("repeatable", derandomize=True, deadline=None)
hypothesis.settings.load_profile("repeatable")


def pytest_ignore_collect(collection_path, config):
    """Of ``pytest -m core`` leave the files without such tests out: they may import any extra."""
    if config.option.markexpr == "core" and collection_path.suffix == ".py":
        return "mark.core" not in collection_path.read_text(encoding="utf-8") or None
    return None


@pytest.fixture(scope="session")
def real_data() -> Path:
    """Return the folder of the measured records, or skip the test where there is none."""
    beside = Path(__file__).resolve().parents[1] / "../shared/data"
    folder = Path(os.environ.get("SKLEARN_PGNN_DATA") or beside).resolve()
    if not folder.is_dir():
        pytest.skip("no measured records here; SKLEARN_PGNN_DATA names their folder")
    return folder


@pytest.fixture(scope="session")
def cases(real_data) -> Path:
    """Return the folder of simulated cases with known answers, or skip the test."""
    folder = real_data.parent / "cases"
    if not folder.is_dir():
        pytest.skip(f"no cases beside {real_data}")
    return folder


@pytest.fixture(scope="module")
def browser():
    """Return a headless Chromium, or skip the test where there is none."""
    playwright = pytest.importorskip("playwright.sync_api")
    names = "chromium", "chromium-browser", "google-chrome"
    found = next(filter(None, map(shutil.which, names)), None)
    with playwright.sync_playwright() as tools:
        try:
            opened = tools.chromium.launch(executable_path=found, args=["--no-sandbox"])
        except playwright.Error as error:
            pytest.skip(f"no Chromium here: {error}")
        yield opened
        opened.close()


@pytest.fixture(scope="module")
def golf():
    """Return records of the golf robot at 100 Hz, with a one-dimensional y."""
    from sklearn_pgnn.datasets import make_golf_robot

    X, y = make_golf_robot(sample_rate=100, duration=3)
    return X, y["phi_measured"].to_numpy()
