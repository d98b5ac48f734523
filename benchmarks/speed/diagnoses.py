"""Whole diagnoses: against the clock, over the number of samples, and where their time goes."""

import cProfile
import pstats
import time
import warnings
from functools import partial

from measure import Row, best_times

from sklearn_pgnn import ModelDiagnosis, datasets, systems

SAMPLES, GROWTH = 40_000, (5_000, 50_000)
#: records of 5 s at 500 Hz
RECORD = {"duration": 5.0, "sample_rate": 500.0}


def records(samples):
    """Hide dry friction in as many records of the golf robot as the samples fill."""
    n_records = round(samples / (RECORD["duration"] * RECORD["sample_rate"]))
    return datasets.make_hidden_effect(
        systems.golf_robot(), "coulomb_friction", n_records=n_records, random_state=0, **RECORD
    )


def diagnose(hidden, jobs=1):
    """Diagnose records."""
    return ModelDiagnosis(hidden.prior, n_jobs=jobs).fit(hidden.X, hidden.y)


def rows():
    """Yield the rows on diagnoses, the models being compiled by a first one."""
    warnings.simplefilter("ignore")
    ways = [partial(diagnose, records(SAMPLES), jobs) for jobs in (2, 1)]
    parallel, serial = best_times(*ways, repeats=2, clock=time.perf_counter)
    work = f"diagnosis of {SAMPLES} samples, one effect, whole catalogue, 2 cores"
    yield Row(work, parallel, "4 s", parallel / 4.0, 1.0)
    yield Row("the same", parallel, "1 core", serial / parallel, 1.0, at_least=True)
    few, many = (best_times(partial(diagnose, records(n)), repeats=1)[0] / n for n in GROWTH)
    work = f"a diagnosis, per sample of {GROWTH[1]}"
    yield Row(work, many * GROWTH[1], f"per sample of {GROWTH[0]}", many / few, 1.3)


def profile(lines=12) -> list[tuple[str, float]]:
    """Return the functions in which a diagnosis spends most time, and their share of it."""
    hidden = records(SAMPLES)
    diagnose(hidden)
    profiler = cProfile.Profile()
    profiler.runcall(diagnose, hidden)
    return shares(profiler, lines)


def shares(profiler, lines) -> list[tuple[str, float]]:
    """Return the functions that take most time themselves, and their share."""
    stats = pstats.Stats(profiler)
    total = stats.total_tt
    own = ((key, entry[2]) for key, entry in stats.stats.items())
    most = sorted(own, key=lambda item: -item[1])[:lines]
    return [(f"{path.rpartition('/')[2]} {name}", took / total) for (path, _, name), took in most]
