"""All candidates as dots on a logarithmic axis, in units of the noise."""

import math
from typing import NamedTuple

from sklearn_pgnn.inspection.cause_names import cause_name
from sklearn_pgnn.inspection.numbers import times
from sklearn_pgnn.inspection.svg import Scale, dot, mark, scale_text, span, strip, whisker
from sklearn_pgnn.inspection.yardstick import left_alone, together

#: candidates that are shown before the rest is folded away
SHOWN = 12
#: what is worse than re-tuning alone by more than this lies beyond the axis
WORST = 1.25


def dot_plot(diagnosis) -> dict | None:
    """Return the first rows and the others; None where no candidate was looked at alone."""
    found, errors = left_alone(diagnosis), together(diagnosis)
    if not found or not math.isfinite(errors.refitted):
        return None
    entries = _entries(diagnosis, found, errors)
    finite = [entry.left for entry in entries if 0 < entry.left < math.inf]
    low = 0.9 * min(1.0, *finite)
    high = max(WORST * errors.refitted, 1.6)
    scale = Scale(low, high, log=True)
    rows = [_row(scale, errors.refitted, entry) for entry in entries]
    return {"shown": rows[:SHOWN], "folded": rows[SHOWN:], "ticks": scale_text(scale)}


class _Entry(NamedTuple):
    """What a candidate leaves, in units of the noise, and where its interval ends."""

    name: str
    left: float
    named: bool
    ends: tuple[float, float] | None = None


def _entries(diagnosis, found, errors) -> list[_Entry]:
    """Return what every candidate leaves; a single cause as the extended model has it."""
    named = {(cause.effect, cause.target) for cause in diagnosis.causes_}
    entries = []
    for candidate in found:
        name, is_named = cause_name(*candidate.name), candidate.name in named
        if is_named and len(named) == 1:
            factor = errors.extended / candidate.left if candidate.left > 0 else math.nan
            ends = factor * candidate.low, factor * candidate.high
            entries.append(_Entry(name, errors.extended, True, ends))
        else:
            entries.append(_Entry(name, candidate.left, is_named, (candidate.low, candidate.high)))
    if len(named) > 1:
        entries.append(_Entry("all named causes together", errors.extended, True))
    return sorted(entries, key=lambda entry: (round(entry.left, 2), not entry.named))


def _row(scale: Scale, refitted: float, entry: _Entry) -> dict:
    is_worse = not entry.left <= WORST * refitted
    said = "makes it worse" if is_worse else times(entry.left)
    at = min(max(float(scale.place(max(entry.left, 1e-300))), 0.0), 1.0)
    text = f"{entry.name}: {said}"
    shapes = [
        span(0.0, float(scale.place(1.0)), "noise-band", "noise"),
        mark(float(scale.place(refitted)), "retuned-mark", f"re-tuned only: {times(refitted)}"),
    ]
    if entry.ends is not None and not is_worse and math.isfinite(sum(entry.ends)):
        low, high = (max(end, 1e-300) for end in entry.ends)
        text += f" (95 %: {times(low)} to {times(high)})"
        first, last = (float(scale.place(end)) for end in (low, high))
        shapes.append(whisker(first, last, "whisker", text))
    shapes.append(dot(at, "named" if entry.named else "candidate", text))
    picture = strip(text, shapes)
    return {"name": entry.name, "left": said, "named": entry.named, "picture": picture}
