"""Before a diagnosis: which parameters of a model records can tell, and what would help."""

from dataclasses import asdict, dataclass, replace
from functools import cached_property

import numpy as np

from sklearn_pgnn.annotations import ArrayLike
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.record_quality.finding import listed
from sklearn_pgnn.record_quality.information import Told, can_be_finer, finer, tell
from sklearn_pgnn.record_quality.lags import FoundLag, find_lags
from sklearn_pgnn.simulation.record_windows import sample_steps
from sklearn_pgnn.simulation.uncertainty import NORMAL_95, Estimate, estimate_of
from sklearn_pgnn.trajectories import read_records

#: half-width of a 95 % interval, as a share of the value, below which a parameter is identifiable,
#: and up to which it is weakly so
TOLD, WEAK = 0.2, 1.0
#: how many times the sampling rate is tried
TIMES = (2, 4, 8, 16)
#: fall of an interval from which on the sampling is too slow
FALL = 0.5
#: what a model leaves, in units of the noise, from which on its intervals are not to be trusted
WRONG = 1.5
#: half-width of an interval from which on it is open
MOST = 100.0
RICH = "inputs of the same range with many frequencies"
#: how many times longer records are worth suggesting
LONGER = 10.0


@dataclass(frozen=True)
class ToldParameter:
    """What records tell of one parameter.

    The `half_width` is that of the 95 % interval that a fit would give, as a share of the value,
    infinite where nothing is told. The verdict is ``"identifiable"`` (less than 0.2), ``"weak"``
    (up to 1) or ``"not"``; the parameters that it is `collinear_with` would have to be known.
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
    def is_doubtful(self) -> bool:
        """Whether the model leaves so much that its intervals are not to be trusted."""
        return WRONG < self.times_noise < np.inf

    @property
    def remarks(self) -> tuple[str, ...]:
        """What is not identifiable, why, and what helps; what comes late; what to beware of."""
        said = [f"{p.name}: {p.reason}. Helps: {p.remedy}." for p in self.parameters if p.reason]
        said += [_late(each) for each in self.lags]
        if self.is_doubtful:
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
    judged, lags = _Judged(told), find_lags(replace(told.found, windowed=told.begun))
    rows = tuple(judged.parameter(i) for i in range(len(judged.names)))
    return Identifiability(rows, lags, told.times_noise, judged.best_record())


def _late(found: FoundLag) -> str:
    """Return a sentence on a lag."""
    reach = (found.high - found.low) / 2 * found.samples / found.lag
    by = f"{abs(found.samples):.2f} ± {reach:.2f} samples ({abs(found.lag):.3g} s)"
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
        self.told, self.half, windows = told, NORMAL_95 * told.errors, told.found.windowed.windows
        self.names = [each.name for each in told.found.fit.freedoms]
        self.rate = 1.0 / float(np.median(sample_steps(windows)))

    @cached_property
    def fine(self) -> dict[int, np.ndarray]:
        """Half-widths at so many times the rate, with as many samples in less time."""
        windows, x0 = self.told.found.windowed.windows, self.told.found.fit.x0
        times = (n for n in TIMES if can_be_finer(windows, n))
        return {n: self.told.half_widths(self.told.under(finer(windows, n), x0) / n) for n in times}

    def parameter(self, place: int) -> ToldParameter:
        """Return the verdict on a parameter."""
        half, told, name = float(self.half[place]), self.told, self.names[place]
        error = float(told.errors[place] * told.size[place])
        estimate = estimate_of(told.found.fit.model, name, {name: error})
        if half < TOLD:
            return ToldParameter(name, estimate, half, "identifiable")
        verdict = "weak" if half <= WEAK else "not"
        if not told.found.fit.usable:
            why = "the model diverges", (), "values with which it does not"
            return ToldParameter(name, estimate, half, verdict, *why)
        others = tuple(self.names[i] for i in told.partners(place, TOLD))
        return ToldParameter(name, estimate, half, verdict, *self._why(place, half, others))

    def _why(
        self, place: int, half: float, others: tuple[str, ...]
    ) -> tuple[str, tuple[str, ...], str]:
        """Return the reason, what is collinear, and what would help."""
        alone = float(self.told.half_widths(self.told.information, [place])[0])
        reason = f"hardly excited: {percent(alone)} even if all others were known"
        remedy = "larger inputs, another output, or a measurement of its own"
        if others:
            reason = f"collinear with {listed(others)}: with known values {percent(alone)}"
            remedy = f"a known value of {listed(others)}, or another output"
        elif not np.isfinite(alone):
            reason = "never excited: no output depends on it in these records"
        if times := self._times(place):
            return "the sampling is too slow for it", others, self._sampling(times)
        if self.told.rich[place] < TOLD:
            return reason, others, f"{RICH} ({percent(self.told.rich[place])})"
        if half <= TOLD * np.sqrt(LONGER):
            return reason, others, f"records {(half / TOLD) ** 2:.2g} times as long"
        return reason, others, remedy

    def _times(self, place: int) -> int | None:
        """Return how many times faster sampling has to be, None where that is not what lacks.

        As many samples have to tell more in less time; more of them repeat what a wrong model does.
        """
        fine, more = self.fine, 0.5 if self.told.times_noise <= WRONG else 0.0
        is_slow = any(half[place] < FALL * self.half[place] for half in fine.values())
        enough = (n for n, half in fine.items() if half[place] < TOLD * n**more)
        return next(enough, None) if is_slow else None

    def _sampling(self, times: int) -> str:
        return f"sampling at {times * self.rate:.4g} Hz"

    def best_record(self) -> str:
        """Return the record that would tell most of what these do not."""
        lacking = [place for place, half in enumerate(self.half) if not half < TOLD]
        if not (lacking and self.told.found.fit.usable):
            return ""
        times = {place: self._times(place) for place in lacking}
        faster = {place: n for place, n in times.items() if n}
        gained = {
            RICH: [place for place in lacking if self.told.rich[place] < TOLD],
            self._sampling(max(faster.values(), default=1)): list(faster),
        }
        best = max(gained, key=lambda what: len(gained[what]))
        names = listed(self.names[i] for i in gained[best])
        return f"{best}: {names} would be identifiable" if names else ""


def percent(half: float) -> str:
    """Return the half-width of an interval, a share of the value, in percent."""
    return f"± {float(f'{100 * half:.2g}'):g} %" if half < MOST else "open"
