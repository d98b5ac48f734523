"""Simulations: against loops written by hand, and against packages that simulate."""

import os
import time
from functools import partial
from unittest.mock import patch

import numpy as np
import peers
from measure import Row, best_times, seconds, times_as_fast, times_as_long

from sklearn_pgnn.effects import CATALOGUE
from sklearn_pgnn.estimation.possible_causes import possible_causes
from sklearn_pgnn.simulation.compiled import compile_model
from sklearn_pgnn.simulation.parameter_sets import simulate_sets
from sklearn_pgnn.simulation.simulate import simulate

STEPS, FEW = 100_000, 2_000
START = np.zeros(2)
NUMBERS, PARAMETER_SETS = 6, 1000


def rows():
    """Yield the rows on simulations."""
    t, u = peers.record(STEPS)
    written = {
        "a numba loop by hand": _looping(peers.numba_loop, t, u),
        "a C loop by hand, gcc -O3": _looping(peers.c_loop(), t, u),
    }
    smooth, dry = _run(peers.PENDULUM, t, u), _run(peers.GOLF, t, u)
    for against, loop in written.items():
        yield times_as_long(f"{STEPS} steps, smooth", smooth, against, loop, 1.2, repeats=15)
    loop = written["a numba loop by hand"]
    name = "the numba loop without friction"
    yield times_as_long(f"{STEPS} steps, dry friction", dry, name, loop, 3.0, repeats=15)
    yield from _sensitivities(t, u)
    casadi = peers.casadi_run(t, u)
    yield times_as_fast(f"{STEPS} steps, smooth", smooth, "CasADi, mapaccum", casadi, 3.0)
    yield from _adaptive(t[:FEW], u[:FEW])
    yield _parameter_sets()
    yield _compiled()


def _looping(loop, t, u):
    return lambda: loop(t, u, np.empty((t.size, 2)))


def _run(model, t, u, wrt=None):
    return lambda: simulate(model, t, u, START, wrt=wrt)


def _sensitivities(t, u):
    """Compare a simulation with sensitivities with so many simulations as there are numbers."""
    for kind, model in (("smooth", peers.PENDULUM), ("dry friction", peers.GOLF)):
        wrt = tuple(model.parameters)[: NUMBERS - len(model.states)]
        mine, plain = best_times(_run(model, t, u, wrt), _run(model, t, u), repeats=15)
        work, n = f"sensitivities of {NUMBERS} numbers, {kind}", NUMBERS + 1
        yield Row(work, mine, f"{n} simulations", mine / plain / n, 0.35)


def _adaptive(t, u):
    """Compare with what chooses its steps itself, SciPy to the accuracy that ours has."""
    mine, samples = _run(peers.PENDULUM, t, u), (t.size, t.size)
    control = peers.control_run(t, u)
    work = f"{FEW} steps, smooth"
    yield times_as_fast(work, mine, "python-control", control, 100.0, samples=samples, repeats=2)
    exact = simulate(peers.PENDULUM, t, u, START, substeps=10).x
    mine_off = np.abs(simulate(peers.PENDULUM, t, u, START).x - exact).max()
    for tolerance in 10.0 ** -np.arange(2.0, 14.0):
        scipy = peers.scipy_run(t, u, tolerance)
        if np.abs(scipy() - exact).max() <= max(mine_off, 1e-13):
            break
    against = f"SciPy at equal accuracy, rtol {tolerance:.0e}"
    yield times_as_fast(work, mine, against, scipy, 100.0, samples=samples, repeats=2)


def _compiled():
    """Time what a candidate costs before it can be simulated, the median of the catalogue."""
    models = [cause.apply(peers.GOLF) for cause in possible_causes(peers.GOLF, CATALOGUE, None)]
    compile_model(peers.GOLF, ())  # loads the compiler
    compilations = [partial(compile_model, model, model.free_parameters) for model in models]
    with patch.dict(os.environ, SKLEARN_PGNN_CACHE_DIR=""):  # what was compiled before is not new
        took = float(np.median([seconds(compilation) for compilation in compilations]))
    work = "compile of a new candidate, median of the catalogue"
    return Row(work, took, "60 ms", took / 60e-3, 1.0)


def _parameter_sets():
    """Simulate a thousand parameter sets on one core and on two."""
    t, u = peers.record(FEW)
    rng = np.random.default_rng(0)
    sets = {"d": rng.uniform(0.005, 0.05, PARAMETER_SETS)}

    def run(jobs):
        return lambda: simulate_sets(peers.GOLF, t, u, START, parameters=sets, n_jobs=jobs)

    work, against = f"{PARAMETER_SETS} parameter sets, {FEW} steps, 2 cores", "1 core"
    return times_as_fast(work, run(2), against, run(1), 1.8, repeats=3, clock=time.perf_counter)
