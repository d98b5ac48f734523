"""Feedback of the states: an input that a controller computed from them."""

from collections.abc import Callable

import numpy as np
from scipy.stats import t as student

from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.record_quality.finding import Finding
from sklearn_pgnn.record_quality.imitation import imitators
from sklearn_pgnn.record_quality.limits import ALPHA, MOST, SHARE
from sklearn_pgnn.record_quality.replay import Replay, replay_inputs, window_states
from sklearn_pgnn.record_quality.state_law import StateLaw, StateRegression
from sklearn_pgnn.record_quality.wording import listed
from sklearn_pgnn.simulation.window_fit import WindowFit


def find_state_feedback(
    problem: EstimationProblem,
    final: WindowFit,
    each_step: Callable[[], bool | None] = lambda: None,
) -> list[Finding]:
    r"""Find inputs that are functions of the states at the same time.

    Where :math:`u = h(x)`, a gain of the input acts as any part of the model does that is
    :math:`h(x)`. But a machine that merely follows its input looks alike: a warm one shows how
    long it was heated. The two cases differ in that an input chosen in advance could as well have
    been run faster or slower. Let a regression on the states leave the share
    :math:`\rho` of an input, held out, and :math:`\rho_1, \dots, \rho_n` where the model is
    simulated with the inputs at :math:`n` other speeds. In open loop all these are alike. Under
    feedback :math:`\rho` is the least by far, beyond chance and by as much as is worth saying,

    .. math::
        \overline{\log \rho_i} - \log \rho > \max\left(
            t_{n - 1, 1 - \alpha}\, s(\log \rho_i) \sqrt{1 + 1/n}, \; -\log c\right),

    with the error rate :math:`\alpha` = `ALPHA` and the share :math:`c` = `SHARE`, which
    :math:`\rho` itself must not exceed either.
    """
    windows, model = problem.windows, final.model
    moving = [i for i in range(windows.u.shape[1]) if np.ptp(windows.u[:, i]) > 0]
    if not moving or not final.usable:
        return []
    x = window_states(problem, final)
    regression = StateRegression(model, windows)
    laws = {}
    for i in moving:
        each_step()
        laws[i] = regression.find(windows.u[:, i], x)
    told = {i: law for i, law in laws.items() if law is not None}
    if not told:
        return []
    replays, findings = [], []
    for ways in replay_inputs(problem, final, x):
        each_step()
        replays.append(ways)
    for i, law in told.items():
        others = [_left(regression, ways, i, law) for ways in replays]
        if _is_least(np.log(_share_left(law)), np.log(others), ALPHA / len(moving)):
            name = list(model.inputs)[i]
            parts = imitators(model, windows, x, name, _share_left(law))
            findings.append(_feedback(name, law, parts))
    return findings


def _left(regression: StateRegression, ways: list[Replay], i: int, law: StateLaw) -> float:
    """Return the least share that a law leaves of an input at one speed.

    NaN where every simulation failed nearly everywhere.
    """
    shares = []
    for way in ways:
        finite = (np.abs(way.x) < np.finfo(np.float32).max).all(axis=1)  # as large as trees take
        good = way.known & finite & np.roll(finite, 1)
        if good.sum() > (1 - MOST) * way.known.sum():
            shares.append(_share_left(regression.judge(way.u[:, i], way.x, law, good)))
    return min(shares, default=np.nan)


def _share_left(law: StateLaw) -> float:
    """Return the share of an input that a law leaves, between rounding and all."""
    return float(np.clip(1.0 - law.share, np.finfo(float).eps, 1.0))


def _is_least(value: float, others: np.ndarray, chance: float) -> bool:
    """Return whether a logarithm lies below others of its kind, by `SHARE` and beyond chance.

    That is a t test of one more draw.
    """
    others = others[np.isfinite(others)]
    if others.size < 2:
        return False
    error = np.std(others, ddof=1) * np.sqrt(1 + 1 / others.size)
    least = max(student.isf(chance, others.size - 1) * error, -np.log(SHARE))
    return bool(np.mean(others) - value > least)


def _feedback(name: str, law: StateLaw, parts: tuple[str, ...]) -> Finding:
    """Return the finding that an input follows a law, and that parts act as its gain does."""
    of = listed(law.states)
    if parts:
        like = f"as {listed(parts)} {'do together' if len(parts) > 1 else 'does'}"
    else:
        like = f"as any missing part does that is the same function of {of}"
    percent = np.floor(1e3 * law.share) / 10
    return Finding(
        "state feedback",
        name,
        f"{name} is a function of {of} at the same time ({percent:.1f} % of its variance, held "
        f"out): a controller computed it. A gain of {name} then acts {like}, and these records "
        f"cannot separate them",
        law.share,
        f"add a test signal to the controller's output that {of} cannot predict, and record the "
        f"reference too; or record in open loop",
    )
