"""All suspects as dots on a logarithmic axis, in units of the noise."""

import math
from dataclasses import dataclass

from markupsafe import Markup

from sklearn_pgnn.inspection.numbers import times
from sklearn_pgnn.inspection.svg import Scale, dot, mark, scale_text, span, strip
from sklearn_pgnn.inspection.words import cause_name
from sklearn_pgnn.inspection.yardstick import suspects, together

#: suspects that are shown before the rest is folded away
SHOWN = 12
#: what is worse than re-tuning alone by more than this lies beyond the axis
WORST = 1.25


@dataclass(frozen=True)
class SuspectRow:
    """A suspect.

    Parameters
    ----------
    name : str
        What it is called.
    left : str
        What it leaves, in words.
    named : bool
        Whether it was named.
    picture : Markup
        Its strip.
    """

    name: str
    left: str
    named: bool
    picture: Markup


@dataclass(frozen=True)
class DotPlot:
    """The suspects.

    Parameters
    ----------
    rows : list of SuspectRow
        The named causes first, then the best.
    ticks : Markup
        The axis.
    """

    rows: list[SuspectRow]
    ticks: Markup

    @property
    def shown(self) -> list[SuspectRow]:
        """The first rows."""
        return self.rows[:SHOWN]

    @property
    def folded(self) -> list[SuspectRow]:
        """The others."""
        return self.rows[SHOWN:]


def dot_plot(diagnosis) -> DotPlot | None:
    """Return the dot plot; None where no suspect was looked at alone.

    Parameters
    ----------
    diagnosis : ModelDiagnosis
        A fitted diagnosis.

    Returns
    -------
    DotPlot or None
        Rows and axis.
    """
    found, errors = suspects(diagnosis), together(diagnosis)
    if not found or not math.isfinite(errors.refitted):
        return None
    entries = _entries(diagnosis, found, errors)
    finite = [left for _, left, _ in entries if 0 < left < math.inf]
    low = 0.9 * min(1.0, *finite)
    high = max(WORST * errors.refitted, 1.6)
    scale = Scale(low, high, log=True)
    rows = [_row(scale, errors.refitted, *entry) for entry in entries]
    return DotPlot(rows, scale_text(scale))


def _entries(diagnosis, found, errors) -> list[tuple[str, float, bool]]:
    """Return what every suspect leaves; a single cause as the extended model has it."""
    named = {(cause.effect, cause.target) for cause in diagnosis.causes_}
    entries = []
    for suspect, left in found:
        is_named = suspect in named
        alone = errors.extended if is_named and len(named) == 1 else left
        entries.append((cause_name(*suspect), alone, is_named))
    if len(named) > 1:
        entries.append(("all named causes together", errors.extended, True))
    return sorted(entries, key=lambda entry: (round(entry[1], 2), not entry[2]))


def _row(scale: Scale, refitted: float, name: str, left: float, named: bool) -> SuspectRow:
    said = times(left) if left <= WORST * refitted else "makes it worse"
    at = min(max(float(scale.place(max(left, 1e-300))), 0.0), 1.0)
    shapes = [
        span(0.0, float(scale.place(1.0)), "noise-band", "noise"),
        mark(float(scale.place(refitted)), "retuned-mark", f"re-tuned only: {times(refitted)}"),
        dot(at, "named" if named else "suspect", f"{name}: {said}"),
    ]
    return SuspectRow(name, said, named, strip(f"{name}: {said}", shapes))
