"""Tune a PGNN-L of the golf robot: neurons, learning rate and lambda_phy, by Bayesian search.

Prints the time, the best candidate, its free-run RMSE on a reference record over that of the
physical model, and whether the pickled estimator predicts the same in another process.
Run: ``python benchmarks/network_search.py [--jobs 2]``.
"""

import argparse
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path

import joblib
import numpy as np
from skopt import BayesSearchCV

from sklearn_pgnn import datasets, make_pgnn_pipeline, model_selection, systems

LOAD = """
import sys, joblib, numpy as np
estimator, X = joblib.load(sys.argv[1])
np.save(sys.argv[2], estimator.predict(X))
"""


def rms(error):
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(error))))


def predict_elsewhere(estimator, X):
    """Predict by the pickled estimator in a fresh process."""
    with tempfile.TemporaryDirectory() as folder:
        pickled, predicted = Path(folder, "net.joblib"), Path(folder, "y.npy")
        joblib.dump((estimator, X), pickled)
        subprocess.run([sys.executable, "-c", LOAD, str(pickled), str(predicted)], check=True)
        return np.load(predicted)


def main():
    """Search, and print what came out."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", type=int, help="of BayesSearchCV; by default left unset")
    jobs = parser.parse_args().jobs
    warnings.simplefilter("ignore")
    golf = systems.golf_robot()
    X, y = datasets.make_golf_robot()
    X_reference, y_reference = datasets.make_golf_robot(reference=True)
    pipeline = make_pgnn_pipeline(golf)
    space = model_selection.search_space(pipeline, layers=None, structure=None, horizon=None)
    print("searched:", ", ".join(space), flush=True)
    start = time.perf_counter()
    folds = model_selection.TrajectoryKFold(3)
    search = BayesSearchCV(pipeline, space, n_iter=8, cv=folds, n_jobs=jobs, random_state=0)
    search.fit(X, y)
    print(f"{time.perf_counter() - start:.0f} s, best: {dict(search.best_params_)}")
    start_state = X_reference[list(golf.states)].iloc[0].to_numpy(dtype=float)
    prior = golf.simulate(X_reference["t"], X_reference[["torque"]], start_state).y
    measured = y_reference.to_numpy()
    predicted = search.predict(X_reference)
    ratio = rms(predicted - measured) / rms(prior - measured)
    print(f"error on the reference record over the physical model's: {ratio:.3f}")
    same = np.array_equal(predict_elsewhere(search.best_estimator_, X_reference), predicted)
    print(f"pickled, it predicts the same in another process: {same}")


if __name__ == "__main__":
    main()
