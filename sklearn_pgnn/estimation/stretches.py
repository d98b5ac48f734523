"""Stretches of long records: the most informative ones, for a search."""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from sklearn_pgnn.estimation.budgets import LONG, STRETCHES
from sklearn_pgnn.estimation.problem import EstimationProblem, build_problem
from sklearn_pgnn.simulation.inputs import mean_inputs
from sklearn_pgnn.simulation.record_windows import MIN_WINDOWS
from sklearn_pgnn.simulation.windows import evaluate
from sklearn_pgnn.trajectories.record import Record, piece_of


def is_long(problem: EstimationProblem) -> bool:
    """Return whether records have more samples than a search uses."""
    return int(problem.windows.lengths.sum()) > LONG


def on_stretches(
    whole: EstimationProblem, records: tuple[Record, ...], options: Mapping[str, Any]
) -> tuple[EstimationProblem, tuple[Record, ...]]:
    """Return the problem on the informative stretches of long records, and the stretches."""
    stretches, factor = telling_stretches(whole, records)
    substeps = options.get("substeps") or whole.prior.simulation.get("substeps")
    options = {
        **options,
        "hold": whole.windows.hold,
        "noise_std": whole.windows.scale,
        "substeps": None if substeps is None else factor * substeps,
    }
    return build_problem(whole.prior, stretches, **options), stretches


def telling_stretches(
    problem: EstimationProblem, records: tuple[Record, ...]
) -> tuple[tuple[Record, ...], int]:
    """Return at most `LONG` samples of long records, in stretches, and the thinning factor.

    Half of the stretches are those in which the prior has the largest error, window by window; the
    others are spread evenly over the rest. If samples are so dense that a stretch would contain few
    windows, they are thinned.
    """
    size = LONG // STRETCHES
    in_window = float(np.median(problem.windows.lengths))
    factor = math.ceil(MIN_WINDOWS * in_window / size)
    spans = list(_spans([record.t.size for record in records], factor * size))
    errors = _errors(problem)
    offsets = problem.windows.bounds
    parts = [errors[offsets[r] + a : offsets[r] + b] for r, a, b in spans]
    told = [float(part.mean()) if part.size else 0.0 for part in parts]
    lengths = np.array([math.ceil((b - a) / factor) for _, a, b in spans])
    chosen = np.sort(_choose(np.array(told), lengths))
    hold = problem.windows.hold
    pieces = [piece_of(records[r], slice(a, b)) for r, a, b in (spans[i] for i in chosen)]
    return tuple(_thin(piece, factor, hold) for piece in pieces), factor


def _spans(sizes: Iterable[int], length: int) -> Iterator[tuple[int, int, int]]:
    """Yield record, first sample and end of stretches of about a given length, end to end."""
    for record, size in enumerate(sizes):
        edges = np.linspace(0, size, max(1, size // length) + 1).astype(int)
        yield from ((record, int(a), int(b)) for a, b in pairwise(edges))


def _errors(problem: EstimationProblem) -> np.ndarray:
    """Return the logarithm of the prior's mean squares in its window, for every sample."""
    windows, model = problem.windows, problem.prior
    x0 = problem.states.estimate(model).x[windows.starts]
    squares = evaluate(model, windows, x0, ()).squares / windows.lengths
    large = np.log1p(np.where(np.isfinite(squares), squares, np.inf).clip(max=1e300))
    return np.repeat(large, windows.lengths)


def _choose(told: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Return the most informative stretches, up to half of the budget, and some of the others."""
    if lengths.sum() <= LONG:
        return np.arange(told.size)
    order = np.argsort(-told, kind="stable")
    first = order[: max(1, np.searchsorted(np.cumsum(lengths[order]), LONG / 2))]
    rest = np.setdiff1d(np.arange(told.size), first)
    budget = LONG - lengths[first].sum()
    count = round(budget / lengths[rest].mean())
    spread = (np.arange(count) + 0.5) * rest.size / max(count, 1)
    others = rest[np.unique(spread.astype(int))]
    return np.concatenate([first, others[np.cumsum(lengths[others]) <= budget]])


def _thin(record: Record, factor: int, hold: str) -> Record:
    """Keep every factor-th sample; held inputs are averaged in between."""
    if factor == 1:
        return record
    kept = np.arange(0, record.t.size, factor)
    bounds = [0, record.t.size]
    return replace(
        record,
        t=record.t[kept],
        u=mean_inputs(record.t, record.u, kept, bounds) if hold == "zoh" else record.u[kept],
        y=None if record.y is None else record.y[kept],
        rows=record.rows[kept],
    )
