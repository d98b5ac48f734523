"""
How much should physics weigh?
==============================

The loss of a PGNN-L weighs the error against a balance of energies by ``lambda_phy``. The balance
is that of the model, and the model of this golf robot has the wrong friction. So the weight is
searched together with the size of the network, and then varied alone, to see what it buys.

Needs ``pip install ".[network,tuning]"``.
"""

# %%
# The search
# ----------
# ``structure="increment"`` makes the network learn the motion itself, from the measured state and
# the simulated one; a balance of energies can tell it something. Every fold leaves out whole
# trajectories; `memory` keeps the simulations, so that no candidate repeats them. The training is
# kept short, as befits an example.
import tempfile

import matplotlib.pyplot as plt
from skopt import BayesSearchCV
from threadpoolctl import threadpool_limits

from sklearn_pgnn import datasets, make_pgnn_pipeline, model_selection, systems

threadpool_limits(1)  # more threads only cost time for a network this small
golf = systems.golf_robot()
X, y = datasets.make_golf_robot(duration=5, sample_rate=100)
short = {"structure": "increment", "max_epochs": 10, "refine_max_iter": 10}

with tempfile.TemporaryDirectory() as memory:
    pipeline = make_pgnn_pipeline(golf, memory=memory, **short)
    space = model_selection.search_space(
        pipeline, layers=None, lr=None, structure=None, horizon=None, neurons=(3, 8)
    )
    folds = model_selection.TrajectoryKFold(2)
    search = BayesSearchCV(pipeline, space, n_iter=4, cv=folds, random_state=0).fit(X, y)

results = zip(search.cv_results_["params"], search.cv_results_["mean_test_score"], strict=True)
for found, score in sorted(results, key=lambda result: -result[1]):
    print({name: round(value, 4) for name, value in found.items()}, f"R2 {score:.4f}")

# %%
# The front
# ---------
# The same network with several weights, on a record that it has not seen: the error of its free
# run, and how far that run is from the model's balance. Beside it the network that corrects the
# model's step, and so has the physics inside.
X_test, y_test = datasets.make_golf_robot(reference=True, duration=5, sample_rate=100)
neurons = search.best_params_["network__module__neurons"]
figure, axes = plt.subplots(layout="constrained")
for structure in ("increment", "correction"):
    judged = pipeline.set_params(
        memory=None, network__structure=structure, network__module__neurons=neurons
    )
    front = model_selection.pareto_front(
        judged, X, y, lambdas=(0.0, 0.03, 0.3, 0.9), X_test=X_test, y_test=y_test
    )
    print(structure, front.round(5).to_string(index=False), sep="\n")
    (line,) = axes.plot(front["physics"], front["error"], "o", mfc="none", label=structure)
    best = front[front["on_front"]].sort_values("physics")
    axes.plot(best["physics"], best["error"], "o-", color=line.get_color())
    for row in front.itertuples():
        where = {"xytext": (5, 4), "textcoords": "offset points", "fontsize": "small"}
        axes.annotate(f"{row.lambda_phy:g}", (row.physics, row.error), **where)

# %%
# What no other weight beats in both is filled; the numbers are the weights. The correcting network
# is nearer to the records and to the balance, whatever the weight. From there on every step towards
# the balance costs accuracy, for the balance has the wrong friction. Increments, which do not know
# the physics, come much nearer to it with a weight, but not to the records; points out of line are
# the draw of a short training.
axes.set(
    xscale="log",
    yscale="log",
    xlabel="mean squared residual of the model's balance",
    ylabel="error of the free run, in spreads of the angle",
)
axes.legend()

# %%
# What it prints and draws, stored by ``python docs/run_examples.py``:
#
# .. literalinclude:: /_static/examples/plot_tune_lambda_phy.txt
#    :language: none
#
# .. image:: /_static/examples/plot_tune_lambda_phy.png
#    :alt: The error over the weight of physics
#
# sphinx_gallery_thumbnail_path = '_static/examples/plot_tune_lambda_phy.png'
