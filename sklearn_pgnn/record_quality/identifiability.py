"""Before a diagnosis: which parameters of a model records can tell, and what would help."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from functools import cached_property

import numpy as np

from sklearn_pgnn.annotations import ArrayLike
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.record_quality.finding import listed
from sklearn_pgnn.record_quality.information import Told, can_be_finer, partners, sample_steps, tell
from sklearn_pgnn.record_quality.lags import FoundLag, find_lags
from sklearn_pgnn.simulation.uncertainty import NORMAL_95, Estimate, estimate_of
from sklearn_pgnn.trajectories import read_records

#: half-width of a 95 % interval, as a share of the value, below which a parameter is identifiable,
#: and up to which it is weakly so
TOLD, WEAK = 0.2, 1.0
#: how many times as many samples in the same time are tried
TIMES = (2, 4, 8, 16)
#: fall of an interval with as many samples in less time from which on the sampling is too slow
FALL = 0.5
#: what a model leaves, in units of the noise, from which on its intervals are not to be trusted
WRONG = 1.5
#: how many times longer records are worth suggesting
LONGER = 10.0


@dataclass(frozen=True)
class ToldParameter:
    """What records tell of one parameter.

    The `estimate` has the 95 % interval that a fit would give; `half_width` is that of the interval
    as a share of the value, infinite where nothing is told. The verdict is ``"identifiable"`` (less
    than 0.2), ``"weak"`` (up to 1) or ``"not"``; then `reason` says why, `collinear_with` names the
    parameters that would have to be known, and `remedy` says what would help.
    """

    name: str
    estimate: Estimate
    half_width: float
    verdict: str
    reason: str = ""
    collinear_with: tuple[str, ...] = ()
    remedy: str = ""


@dataclass(frozen=True)
class Identifiability:
    """What records can tell of a model's free parameters.

    Parameters
    ----------
    parameters : tuple of ToldParameter
        Every free parameter, with the interval to be expected and a verdict.
    lags : tuple of FoundLag
        Outputs that come later or earlier than the model says [s].
    times_noise : float
        What the model leaves with these values, in units of the noise. The intervals hold as far
        as the model does.
    best_record : str
        The record that would tell most of the others; empty if none is needed, or helps.

    Examples
    --------
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(K*L*u - y)/T"}, {"K": 1, "L": 1, "T": 2}, {"u": "V"})
    >>> t = np.linspace(0, 20, 401)
    >>> y = lag.simulate(t, np.sin(t)).y + 0.01 * np.random.default_rng(0).normal(size=(401, 1))
    >>> for told in identifiability(lag, np.column_stack([t, np.sin(t)]), y).parameters:
    ...     print(told.name, told.verdict, told.collinear_with)
    K not ('L',)
    L not ('K',)
    T identifiable ()
    """

    parameters: tuple[ToldParameter, ...]
    lags: tuple[FoundLag, ...]
    times_noise: float
    best_record: str = ""

    @property
    def lacking(self) -> tuple[str, ...]:
        """What is not identifiable, each with the reason and what would help, in sentences."""
        lacking = (each for each in self.parameters if each.reason)
        return tuple(f"{p.name}: {p.reason}. Helps: {p.remedy}." for p in lacking)

    @property
    def remarks(self) -> tuple[str, ...]:
        """What else these records tell, in sentences."""
        said = [_late(each) for each in self.lags]
        if self.times_noise > WRONG:
            said.append(
                f"The fitted model leaves {self.times_noise:.3g} times the noise: something is "
                f"wrong or missing, and the intervals hold only as far as the model does."
            )
        if self.best_record:
            said.append(f"Most would be gained with {self.best_record}.")
        return tuple(said)

    def to_dict(self) -> dict:
        """Return all as plain data."""
        return asdict(self)


def identifiability(model: PhysicsModel, X: ArrayLike, y: ArrayLike) -> Identifiability:
    r"""Tell in seconds which free parameters of a model records can tell.

    The parameters are fitted from their given values. With the information :math:`H` at the fit,
    all initial states free, the half-width of the 95 % interval of a parameter is
    :math:`1.96 \sqrt{\phi_i [H^{-1}]_{ii}}`, where :math:`\phi_i \ge 1` is for residuals that are
    not white, as in `PhysicsModelRegressor`. The information that other records would have, with
    richer inputs or more samples, follows from simulation.

    Parameters
    ----------
    model : PhysicsModel
        The model; its free parameters are looked at.
    X : DataFrame or array of shape (n_samples, n_columns)
        Time [s], inputs and, where known, initial states; see `ModelDiagnosis.fit`.
    y : array-like of shape (n_samples, n_outputs) or (n_samples,)
        Measured outputs.

    Returns
    -------
    Identifiability
        A verdict on every parameter, the lags between the outputs and the model, and the record
        that would help most.

    Raises
    ------
    RecordError
        If X or y cannot be read as records of the model.

    Examples
    --------
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> t = np.linspace(0, 20, 401)
    >>> rng = np.random.default_rng(0)
    >>> y = lag.simulate(t, np.sin(t - 0.1)).y + 0.01 * rng.normal(size=(401, 1))
    >>> found = identifiability(lag, np.column_stack([t, np.sin(t)]), y)
    >>> found.parameters[0].verdict, round(found.lags[0].lag, 2)
    ('identifiable', 0.1)
    """
    told = tell(model, read_records(model, X, y))
    fit = told.found.fit
    judged = _Judged(told)
    count = max(int(np.isfinite(fit.evaluation.residual).sum()), 1)
    left = float(np.sqrt(fit.squares / count)) if fit.usable else np.inf
    rows = tuple(judged.parameter(i) for i in range(len(told.names)))
    return Identifiability(rows, find_lags(told.found, told.is_late), left, judged.best_record())


def _late(found: FoundLag) -> str:
    """Return a sentence on a lag."""
    by = f"{abs(found.samples):.2f} samples ({abs(found.lag):.3g} s)"
    alike = f" (a wrong {listed(found.confused_with)} would look alike)"
    half = " or interpolate the inputs (hold: foh)" if -0.6 < found.samples < -0.4 else ""
    return (
        f"{found.output} comes {by} {'later' if found.lag > 0 else 'earlier'} than the model says"
        f"{alike if found.confused_with else ''}, and with that little but noise is left. Remedy: "
        f"record on one clock, shift the column{half}, or add the delay to the model."
    )


class _Judged:
    """Verdicts on the parameters, and the reasons."""

    def __init__(self, told: Told):
        self.told = told
        self.half = NORMAL_95 * told.errors
        self.model = told.found.fit.model

    @cached_property
    def rich(self) -> np.ndarray:
        """Half-widths under richer inputs."""
        return self.told.half_widths(self.told.with_rich_inputs())

    @cached_property
    def fine(self) -> dict[int, tuple[np.ndarray, np.ndarray]]:
        """Half-widths with more samples in the same time, and with as many in less."""
        windows, found = self.told.found.windowed.windows, {}
        for times in (n for n in TIMES if can_be_finer(windows, n)):
            more = self.told.sampled(times)
            found[times] = self.told.half_widths(more), self.told.half_widths(more / times)
        return found

    def parameter(self, place: int) -> ToldParameter:
        """Return the verdict on a parameter."""
        half, told, name = float(self.half[place]), self.told, self.told.names[place]
        error = float(told.errors[place] * told.size[place])
        estimate = estimate_of(self.model, name, {name: error})
        if half < TOLD:
            return ToldParameter(name, estimate, half, "identifiable")
        verdict = "weak" if half <= WEAK else "not"
        if not told.found.fit.usable:
            reason, remedy = "the model diverges", "values with which it does not"
            return ToldParameter(name, estimate, half, verdict, reason, (), remedy)
        others = tuple(told.names[i] for i in partners(told, place, TOLD))
        times = self._times(place)
        reason = self._reason(place, others, times)
        return ToldParameter(
            name, estimate, half, verdict, reason, others, self._remedy(place, others, times)
        )

    def _times(self, place: int) -> int | None:
        """Return how many times faster sampling has to be, None where that is not what lacks."""
        half = float(self.half[place])
        told = [times for times, (all_, _) in self.fine.items() if all_[place] < TOLD]
        slow = [times for times, (_, same) in self.fine.items() if same[place] < FALL * half]
        return min(told) if told and slow else None

    def _reason(self, place: int, others: tuple[str, ...], times: int | None) -> str:
        alone = float(self.told.half_widths(self.told.information, [place])[0])
        if times is not None:
            return "the sampling is too slow for it"
        if others:
            return f"collinear with {listed(others)}: with known values {_share(alone)}"
        if not np.isfinite(alone):
            return "never excited: no output depends on it in these records"
        return f"hardly excited: {_share(alone)} even if all others were known"

    def _remedy(self, place: int, others: tuple[str, ...], times: int | None) -> str:
        half = float(self.half[place])
        longer = (half / TOLD) ** 2
        if times is not None:
            return f"sampling at {times * self._rate:.3g} Hz"
        if self.rich[place] < TOLD:
            return f"inputs of the same range with many frequencies ({_share(self.rich[place])})"
        if longer <= LONGER:
            return f"records {longer:.2g} times as long"
        if others:
            return f"a known value of {listed(others)}, or another output"
        return "larger inputs, another output, or a measurement of its own"

    @property
    def _rate(self) -> float:
        """Sampling rate [Hz]."""
        return 1.0 / float(np.median(sample_steps(self.told.found.windowed.windows)))

    def best_record(self) -> str:
        """Return the record that would tell most of what these do not."""
        lacking = np.flatnonzero(~(self.half < TOLD))
        if not (lacking.size and self.told.found.fit.usable):
            return ""
        tried = {"inputs of the same range with many frequencies": self.rich}
        for times, (half, _) in self.fine.items():
            tried[f"sampling at {times * self._rate:.3g} Hz"] = half
        gained = {what: self._told_by(half, lacking) for what, half in tried.items()}
        best = max(gained, key=lambda what: len(gained[what]))
        if not gained[best]:
            return ""
        return f"{best}: {listed(gained[best])} would be identifiable"

    def _told_by(self, half: np.ndarray, lacking: Iterable[int]) -> list[str]:
        return [self.told.names[i] for i in lacking if half[i] < TOLD]


def _share(half: float) -> str:
    return f"± {100 * half:.2g} %" if np.isfinite(half) else "nothing"
