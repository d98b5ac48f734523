"""SINDYc beside pysindy on the same samples: the fit, and the free run of what was found."""

import warnings

import numpy as np
import pandas as pd
import pysindy
from measure import times_as_fast, times_as_long

from sklearn_pgnn import PhysicsModel, SINDYcRegressor

CART = PhysicsModel(
    states={"x": "m", "v": "m/s"},
    equations={"x": "v", "v": "force - 9*x - 0.5*v - 4*x**3"},
    inputs={"force": "N"},
    outputs={"x": "x", "v": "v"},
)
INTERVAL, NOISE, DEGREE, SAMPLES, FEW = 0.01, 0.002, 3, 20_000, 400


def record(samples):
    """Make a record of the cart: time, force, position and speed."""
    random = np.random.default_rng(0)
    t = INTERVAL * np.arange(samples)
    rates, phases = random.uniform(0.3, 4.0, 5), random.uniform(0, 2 * np.pi, 5)
    force = 2 * np.sin(np.outer(t, rates) + phases).sum(axis=1)
    y = CART.simulate(t, force, substeps=2).y
    return t, force, y + NOISE * random.standard_normal(y.shape)


def estimators():
    """Return our regressor and pysindy's."""
    theirs = pysindy.SINDy(
        optimizer=pysindy.STLSQ(threshold=0.05),
        feature_library=pysindy.PolynomialLibrary(DEGREE),
        differentiation_method=pysindy.SmoothedFiniteDifference(),
    )
    return SINDYcRegressor(degree=DEGREE), theirs


def fits(samples):
    """Return our fit and pysindy's to the same samples, to be run."""
    (t, force, y), (ours, theirs) = record(samples), estimators()
    X = pd.DataFrame({"t": t, "force": force})
    Y = pd.DataFrame(y, columns=["x", "v"])
    return lambda: ours.fit(X, Y), lambda: theirs.fit(y, t=t, u=force[:, None])


def rows():
    """Yield the rows on SINDYc."""
    warnings.simplefilter("ignore")
    fit, their_fit = fits(SAMPLES)
    yield times_as_long(f"SINDYc, fit to {SAMPLES} samples", fit, "pysindy", their_fit, 1.5)
    ours, theirs = fit(), their_fit()
    t, force, y = record(SAMPLES)
    X = pd.DataFrame({"t": t, "force": force})
    yield times_as_fast(
        f"SINDYc, free run of {SAMPLES} samples", lambda: ours.predict(X),
        f"pysindy's simulate, {FEW} samples",
        lambda: theirs.simulate(y[0], t[:FEW], u=force[:FEW, None]), 1000.0,
        samples=(SAMPLES, FEW), repeats=2,
    )  # fmt: skip
