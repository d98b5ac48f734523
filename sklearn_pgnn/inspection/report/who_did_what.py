"""Error breakdown: what re-tuning and each cause remove, and what is left."""

import math
from dataclasses import dataclass

from sklearn_pgnn.inspection.cause_names import cause_name
from sklearn_pgnn.inspection.numbers import times
from sklearn_pgnn.inspection.yardstick import together


@dataclass(frozen=True)
class Part:
    """A part of the given model's error.

    Its kind is ``"retuning"``, ``"cause"``, ``"formula"``, ``"left"`` or ``"noise"``; the errors
    before and after it are in units of the noise.
    """

    kind: str
    name: str
    before: float
    after: float

    @property
    def size(self) -> float:
        """The part of the error, in units of the noise; not below zero."""
        return max(self.before - self.after, 0.0)


def parts_of_error(diagnosis) -> list[Part]:
    """Return the given model's error, part by part, from re-tuning down to the noise.

    Every cause stands for what it takes away beside those before it.
    """
    errors = together(diagnosis)
    parts = [Part("retuning", "re-tuning", errors.prior, errors.refitted)]
    level = errors.refitted
    for cause in diagnosis.causes_:
        after = level * (1.0 - cause.gain / 100.0)
        parts.append(Part("cause", cause_name(cause.effect, cause.target), level, after))
        level = after
    if diagnosis.discrepancy_ is not None:
        parts.append(Part("formula", "the formula", errors.extended, errors.formula))
    noise = min(errors.best, 1.0)
    if errors.best > noise:
        parts.append(Part("left", "left over", errors.best, noise))
    parts.append(Part("noise", "noise", noise, 0.0))
    return parts


@dataclass(frozen=True)
class Segment:
    """A part as it is drawn.

    Where it begins and how wide it is, are in percent of the whole.
    """

    part: Part
    start: str
    width: str
    text: str

    @property
    def css(self) -> str:
        """What its colour is called."""
        return "left-over" if self.part.kind == "left" else self.part.kind


def segments_of_bar(diagnosis) -> list[Segment]:
    """Return the bar of the parts; empty where an error is not finite."""
    parts = parts_of_error(diagnosis)
    whole = sum(part.size for part in parts)
    if not (math.isfinite(whole) and whole > 0):
        return []
    segments, start = [], 0.0
    for part in parts:
        width = 100.0 * part.size / whole
        segments.append(Segment(part, f"{start:.2f}", f"{width:.2f}", _said(part)))
        start += width
    return segments


def _said(part: Part) -> str:
    if part.kind == "noise":
        return f"noise: {times(part.before)}"
    if part.kind == "left":
        return f"left over: {times(part.before)}, of which {times(part.after)} is noise"
    if not part.size:
        return f"{part.name}: nothing"
    return f"{part.name}: {times(part.before)} → {times(part.after)}"
