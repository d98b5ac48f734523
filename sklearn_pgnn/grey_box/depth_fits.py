"""Fits of a depth by its name: alone, or on the physical depth below it."""

import numpy as np

from sklearn_pgnn.exceptions import TrainingError
from sklearn_pgnn.grey_box.default_parts import network_or_default
from sklearn_pgnn.grey_box.depth import FittedDepth, fit_network, fit_physics
from sklearn_pgnn.grey_box.depth_warnings import warn_of_training
from sklearn_pgnn.grey_box.possible_depths import NETWORKS
from sklearn_pgnn.grey_box.tables import PlainTable
from sklearn_pgnn.physics.model import PhysicsModel


def fit_depth(depth, model, table, visible, n_jobs=None) -> FittedDepth:
    """Fit a physical depth; for the prior only the initial states of the trajectories."""
    return fit_physics(model, table, visible, n_jobs, free=() if depth == "prior" else None)


def train_depth(network, depth, physics, table, visible) -> FittedDepth:
    """Train a network on a physical depth that was fitted to the same samples."""
    return fit_network(network, physics, table, visible, sees_inputs=depth == "network")


def fit_chosen(
    depth: str,
    base: str,
    candidates: dict[str, PhysicsModel],
    network,
    table: PlainTable,
    n_jobs: int | None = None,
) -> tuple[str, FittedDepth]:
    """Fit a depth to all samples; where the network's training fails, the one below it.

    `base` is the physical depth on which networks are trained, and `candidates` are the models of
    the physical depths. Return the depth that was fitted, and its fit.
    """
    everything = np.ones(len(table.X), dtype=bool)
    physical = base if depth in NETWORKS else depth
    fitted = fit_depth(physical, candidates[physical], table, everything, n_jobs)
    if depth not in NETWORKS:
        return depth, fitted
    try:
        return depth, train_depth(network_or_default(network), depth, fitted, table, everything)
    except TrainingError as error:
        warn_of_training(error, depth, base)
        return base, fitted
