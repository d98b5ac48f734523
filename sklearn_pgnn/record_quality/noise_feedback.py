"""Feedback of the noise: an input that responds to the noise of an output's sensor."""

from collections.abc import Sequence

import numpy as np
from scipy.stats import chi2

from sklearn_pgnn.record_quality.finding import Finding
from sklearn_pgnn.record_quality.limits import ALPHA, LAGS, SHARE
from sklearn_pgnn.record_quality.signals import Signal


def find_closed_loop(
    outputs: Sequence[Signal], inputs: Sequence[Signal], left: Sequence[Signal]
) -> Finding | None:
    r"""Find an input that follows the noise of an output.

    The noise :math:`\varepsilon` that the extended model leaves and the part :math:`\nu` of an
    input that its own past does not tell are independent in open loop, whatever the input. With
    the share :math:`R^2` of :math:`\varepsilon_k` that a regression on
    :math:`\nu_k, \dots, \nu_{k+M}` explains,

    .. math:: n R^2 \sim \chi^2_{M+1}.

    It is looked for only where the model leaves no more than noise, and counts only where the
    noise makes up a part of :math:`\nu`.

    .. [1] L. D. Haugh, "Checking the independence of two covariance-stationary time series",
       Journal of the American Statistical Association 71, 1976,
       :doi:`10.1080/01621459.1976.10480353`.
    """
    chance = ALPHA / max(len(outputs) * len(inputs), 1)
    for signal, rest in zip(outputs, left, strict=True):
        if not signal.noisy or _excess(rest) > SHARE:
            continue
        noise = _innovations(rest.pieces)
        for source in inputs:
            correlation = _follows(noise, _innovations(source.pieces), chance)
            if correlation:
                return _loop(signal.name, source.name, correlation)
    return None


def _loop(output: str, source: str, correlation: float) -> Finding:
    return Finding(
        "closed loop",
        source,
        f"{source} follows the noise of {output} (correlation {correlation:.2f}): it was commanded "
        f"by a controller that measures {output}",
        correlation,
        "record in open loop, or add a test signal to the command that is large compared with the "
        "noise; do not trust a cause found from an input that follows the error",
    )


def _excess(rest: Signal) -> float:
    """Return the share of the left power that is more than white noise."""
    steps = np.concatenate([np.diff(piece[np.isfinite(piece)]) for piece in rest.pieces])
    return float(1 - np.nanmean(steps**2) / 2 / np.nanmean(rest.values**2))


def _innovations(pieces: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return what the past does not predict of a series; NaN where it is not known."""
    windows = [np.lib.stride_tricks.sliding_window_view(p, LAGS + 1) for p in pieces
               if p.size > LAGS]  # fmt: skip
    if not windows:
        return [np.full(p.size, np.nan) for p in pieces]
    rows = np.concatenate(windows)
    rows = rows[np.isfinite(rows).all(axis=1)]
    past = np.column_stack([rows[:, :-1], np.ones(len(rows))])
    weights = np.linalg.lstsq(past, rows[:, -1], rcond=None)[0]
    found = []
    for piece in pieces:
        new = np.full(piece.size, np.nan)
        if piece.size > LAGS:
            window = np.lib.stride_tricks.sliding_window_view(piece, LAGS + 1)
            new[LAGS:] = window[:, -1] - window[:, :-1] @ weights[:-1] - weights[-1]
        found.append(new)
    return found


def _follows(noise: Sequence[np.ndarray], news: Sequence[np.ndarray], chance: float) -> float:
    """Return the largest correlation of noise with what an input brings next; 0 if by chance."""
    pairs = [_ahead(e, v) for e, v in zip(noise, news, strict=True) if e.size > LAGS]
    rows = np.concatenate([np.zeros((0, LAGS + 2)), *pairs])
    rows = rows[np.isfinite(rows).all(axis=1)]
    size = np.sqrt(np.mean(rows**2, axis=0)) if len(rows) else np.zeros(1)
    if not size.min() > 0:
        return 0.0
    own, ahead = rows[:, 0] / size[0], rows[:, 1:] / size[1:]
    weights, _, rank, _ = np.linalg.lstsq(ahead, own, rcond=1e-8)
    statistic = len(rows) - float(np.sum((own - ahead @ weights) ** 2))
    correlations = own @ ahead / len(rows)
    part = float(np.sum(correlations**2)) - ahead.shape[1] / len(rows)
    follows = statistic > chi2.isf(chance, rank) and part > SHARE
    return float(np.abs(correlations).max()) if follows else 0.0


def _ahead(noise: np.ndarray, news: np.ndarray) -> np.ndarray:
    """Return the noise of every sample beside what the input brings from there on."""
    future = np.lib.stride_tricks.sliding_window_view(news, LAGS + 1)
    return np.column_stack([noise[: len(future)], future])
