"""From records to the network to train: the structure, its step, and the scale of errors."""

from dataclasses import replace

import numpy as np

from sklearn_pgnn.estimators.network.features import feature_scale
from sklearn_pgnn.estimators.network.records import TrainingRecord, TrainingWindows, spread_of
from sklearn_pgnn.estimators.network.structure import (
    ON_THE_MODEL,
    STRUCTURES,
    TRIAL_SHARE,
    base_of,
    choose_structure,
    dissipation_of,
    gain_of,
    lossy_states,
)
from sklearn_pgnn.estimators.one_warning import one_simulation_warning
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.network_run import NetworkStep, run_network
from sklearn_pgnn.simulation.record_windows import dominant_period
from sklearn_pgnn.simulation.simulate import simulate
from sklearn_pgnn.trajectories.measured import of_measured

#: number of windows in which the model is compared with persistence
TRIALS = 200
#: a state this many standard deviations away from its mean has diverged
REACH = 1e3


@one_simulation_warning()
def find_structure(model: PhysicsModel, records, states, **options) -> str:
    """Compare the model with persistence, a tenth of the outputs' dominant period ahead.

    Return ``"increment"`` or ``"correction"``; `states` are those of the records as estimated, and
    `options` those of the simulation.
    """
    ahead = TRIAL_SHARE * dominant_period(records)
    count = max(1, TRIALS // len(records))
    trials = []
    for record, x in zip(records, states, strict=True):
        length = int(np.clip(round(ahead / np.median(np.diff(record.t))), 1, len(x) - 1))
        starts = np.linspace(0, len(x) - 1 - length, count).astype(int)
        for k in np.unique(starts):
            rows = slice(k, k + length + 1)
            run = simulate(model, record.t[rows], record.u[rows], x[k], **options)
            if run.success:
                trials.append((x[k + length], run.x[-1], x[k]))
    return choose_structure(*np.swapaxes(trials, 0, 1)) if trials else "increment"


def check_structure(structure: str, guide, has_model: bool) -> None:
    """Refuse a structure or a guide that is invalid, or that lacks the model it needs."""
    if structure not in ("auto", *STRUCTURES):
        raise ValueError(
            f"structure: expected 'auto' or one of {', '.join(STRUCTURES)}, got {structure!r}."
        )
    if guide not in ("auto", "simulation", "step", "terms", None):
        raise ValueError(
            f"guide: expected 'auto', 'simulation', 'step', 'terms' or None, got {guide!r}."
        )
    if not has_model and (structure in ON_THE_MODEL or guide not in ("auto", None)):
        what = f"structure={structure!r}" if structure in ON_THE_MODEL else f"guide={guide!r}"
        raise ValueError(f"{what} needs a model, got none. Remedy: give model=.")
    if structure == "dissipative" and guide == "step":
        raise ValueError(
            "guide='step' cannot be combined with structure='dissipative', whose network sees the "
            "end of the model's step. Remedy: guide='terms' or guide=None."
        )


def make_step(
    model: PhysicsModel,
    windows: TrainingWindows,
    structure: str,
    guide,
    *,
    hold: str,
    substeps: int,
    corrects=None,
    sees=None,
    further=(),
    middle=False,
) -> NetworkStep:
    """Scale the inputs and outputs of the network by the training data.

    `corrects` are the only states whose rates are corrected, `sees` the only quantities that the
    network sees, and `further` names the further columns; `middle` is whether it sees the state in
    the middle of the model's step. The step is still without the core's sizes.
    """
    now = windows.pairs
    after, dt = now + 1, windows.samples["dt"][now]
    x, prior = windows.x[now], windows.prior[now]
    seen = [windows.seen[now], windows.u[now]]
    if guide == "simulation":
        seen.append(windows.simulated[after])
    elif guide == "step":
        seen.append((prior - x) / dt[:, None])
    elif guide == "terms":
        seen.append(windows.terms[now])
    z = np.hstack([*seen, windows.features[after]])
    mean, spread = x.mean(axis=0), spread_of(x)
    if structure == "dissipative":
        here = {name: part[now] for name, part in windows.samples.items()}
        states = lossy_states(model, corrects)
        loss = dissipation_of(model, states, here, windows.x[after], prior)
        gain = np.zeros((3, x.shape[1], loss.n_outputs))
    else:
        loss, gain = None, gain_of(model, structure, x, windows.x[after], prior, dt, corrects)
    return NetworkStep(
        model,
        base_of(structure),
        guide,
        windows.x[after].mean(axis=0),
        gain,
        z.mean(axis=0),
        feature_scale(model, guide, spread_of(z), sees, further),
        mean + REACH * np.array([[-1.0], [1.0]]) * spread,
        substeps=substeps,
        hold=hold,
        spread=spread_of(windows.seen[now]),
        middle=middle,
        loss=loss,
    )


def base_error(step: NetworkStep, records: list[TrainingRecord], outputs, length: int | None):
    """Measure the root mean square error of the outputs of the base alone.

    `outputs` returns the outputs of a `NetworkRecord` and its states; `length` is steps after which
    the base starts again from the measured state, None for never. The error, of shape (n_outputs,),
    is positive.
    """
    n_in, n_out = len(step.mean), step.n_network_outputs
    idle = replace(step, sizes=(n_in, n_out), loss=None)
    zero = np.zeros((n_in + 1) * n_out)
    squares = []
    for each in records:
        count = len(each.x) - 1
        for k in range(0, count, length or count):
            end = min(k + (length or count), count) + 1
            piece = each.record.piece(k, end, each.x[k] if k else None)
            x = run_network(idle, zero, piece)[0]
            squares.append((outputs(piece, x) - each.y[k : k + len(x)])[1:] ** 2)
    error = np.sqrt(of_measured(np.nanmean, np.concatenate(squares)))
    return np.where(error > 0, error, 1.0)
