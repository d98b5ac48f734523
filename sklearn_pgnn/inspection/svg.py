"""Plots as inline SVG: as wide as the page, styled by its classes, readable without scripts.

Places are told in percent, and curves lie in a nested picture that is stretched, so that letters
keep their size on a screen of any width.
"""

import math
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

#: side of the picture that is stretched, and bins of a curve beyond which it is thinned out
SIDE, BINS = 1000, 700


@dataclass(frozen=True)
class Scale:
    """An axis between two different values."""

    low: float
    high: float
    log: bool = False

    @classmethod
    def over(cls, *values, room: float = 0.05) -> "Scale":
        """Return an axis over all finite values, with some room at its ends."""
        every = np.concatenate([np.ravel(value) for value in values])
        every = every[np.isfinite(every)]
        low, high = (every.min(), every.max()) if every.size else (0.0, 1.0)
        if low == high:
            return cls(float(low - (abs(low) or 1.0)), float(high + (abs(high) or 1.0)))
        reach = room * (high - low)
        return cls(float(low - reach), float(high + reach))

    def place(self, values) -> np.ndarray:
        """Return where values lie, from 0 at the low end to 1 at the high end."""
        values = np.asarray(values, dtype=float)
        if not self.log:
            return (values - self.low) / (self.high - self.low)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.log(values / self.low) / math.log(self.high / self.low)

    def ticks(self, most: int = 6) -> list[float]:
        """Return round values on the axis, at most some."""
        return self._round_factors(most) if self.log else self._round_steps(most)

    def _round_steps(self, most: int) -> list[float]:
        rough = (self.high - self.low) / most
        power = 10.0 ** math.floor(math.log10(rough))
        round_ones = (0.5, 1, 2, 5, 10)
        place = next(i for i in (1, 2, 3, 4) if round_ones[i] * power >= rough * (1 - 1e-9))
        found = self._multiples(round_ones[place] * power)
        return found if len(found) > 1 else self._multiples(round_ones[place - 1] * power)

    def _multiples(self, step: float) -> list[float]:
        first, last = math.ceil(self.low / step), math.floor(self.high / step)
        return [round(k * step, 12 - math.floor(math.log10(step))) for k in range(first, last + 1)]

    def _round_factors(self, most: int) -> list[float]:
        powers = range(math.floor(math.log10(self.low)), math.ceil(math.log10(self.high)) + 1)
        for factors in ((1, 1.5, 2, 3, 4, 5, 7), (1, 2, 5), (1, 3), (1,)):
            found = [f * 10.0**p for p in powers for f in factors]
            inside = [
                v for v in found if self.low <= v * (1 + 1e-9) and v <= self.high * (1 + 1e-9)
            ]
            if len(inside) <= most:
                return inside
        return inside[:: -(-len(inside) // most)]


def percent(share) -> str:
    """Return a place for an attribute of SVG.

    >>> percent(0.25)
    '25%'
    """
    return f"{100 * float(share):.2f}".rstrip("0").rstrip(".") + "%"


class Plot:
    """A plot; `label` is for those who do not see it, `css` are classes, as "low"."""

    def __init__(self, x: Scale, y: Scale, label: str, css: str = ""):
        self.x, self.y, self.label, self.css = x, y, label, css
        self._shapes: list[Markup] = []

    def line(self, x, y, css: str, title: str = "") -> None:
        """Draw a curve; it is interrupted where a value is not finite."""
        x, y = thinned(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        self._path(_polyline(*self._on_picture(x, y)), f"line {css}", title)

    def points(self, x, y, css: str, title: str = "") -> None:
        """Draw dots."""
        h, v = self._on_picture(x, y)
        good = np.isfinite(h) & np.isfinite(v)
        dots = (f"M{_short(a)} {_short(b)}h0" for a, b in zip(h[good], v[good], strict=True))
        self._path("".join(dots), f"dots {css}", title)

    def stems(self, x, y, css: str, title: str = "") -> None:
        """Draw upright lines from zero."""
        h, v = self._on_picture(x, y)
        zero = _short(float(self._on_picture(np.zeros(1), np.zeros(1))[1][0]))
        stems = (f"M{_short(a)} {zero}V{_short(b)}" for a, b in zip(h, v, strict=True))
        self._path("".join(stems), f"line {css}", title)

    def shade(self, low: float, high: float, css: str, title: str = "") -> None:
        """Shade from one abscissa to another."""
        a, b = np.clip(self.x.place([low, high]), 0.0, 1.0)
        self._rectangle((a, 0.0, b - a, 1.0), css, title)

    def band(self, low: float, high: float, css: str, title: str = "") -> None:
        """Shade from one ordinate to another."""
        a, b = np.clip(self.y.place([low, high]), 0.0, 1.0)
        self._rectangle((0.0, 1.0 - b, 1.0, b - a), css, title)

    def between(self, x, low, high, css: str, title: str = "") -> None:
        """Shade between two curves."""
        there, back = self._on_picture(x, low), self._on_picture(x[::-1], high[::-1])
        outline = (np.concatenate(pair) for pair in zip(there, back, strict=True))
        self._path(_polyline(*outline) + "z", css, title)

    def cells(self, x, y, width: float, height: float, css: str, opacity: float = 1.0) -> None:
        """Draw equal cells of one colour, told by their lower left corners."""
        h, v = self._on_picture(x, y)
        w = SIDE * width / (self.x.high - self.x.low)
        up = SIDE * height / (self.y.high - self.y.low)
        shape = f"h{_short(w)}v{_short(-up)}h{_short(-w)}z"
        path = "".join(f"M{_short(a)} {_short(b)}{shape}" for a, b in zip(h, v, strict=True))
        cells = Markup('<path class="cells {}" fill-opacity="{:.2f}" d="{}"/>')
        self._shapes.append(cells.format(css, opacity, path))

    def html(self) -> Markup:
        """Return the plot as HTML."""
        inner = Markup("").join(self._shapes)
        return Markup(
            '<div class="plot {}"><svg class="area" role="img" aria-label="{}"{}>{}'
            '<svg class="inner" width="100%" height="100%" viewBox="0 0 {s} {s}" '
            'preserveAspectRatio="none">{}</svg></svg></div>'
        ).format(self.css, self.label, self._ends(), self._axes(), inner, s=SIDE)

    def _ends(self) -> Markup:
        """Return the ends of the axes, for a script that makes a part large."""
        if self.x.log or self.y.log:
            return Markup("")
        ends = (f"{scale.low:.9g} {scale.high:.9g}" for scale in (self.x, self.y))
        return Markup(' data-x="{}" data-y="{}"').format(*ends)

    def _axes(self) -> Markup:
        parts = [Markup('<rect class="frame" width="100%" height="100%"/>')]
        marks = self.x.ticks()
        grid = (
            '<line class="grid" x1="{0}" x2="{0}" y1="0" y2="100%"/>'
            '<text class="below" x="{0}" y="100%" dy="15">{1}</text>'
        )
        for value, said in zip(marks, tick_labels(marks), strict=True):
            parts.append(Markup(grid).format(percent(self.x.place(value)), said))
        marks = self.y.ticks(4 if "low" in self.css.split() else 6)
        grid = (
            '<line class="grid" x1="0" x2="100%" y1="{0}" y2="{0}"/>'
            '<text class="beside" x="0" y="{0}" dx="-6" dy="4">{1}</text>'
        )
        for value, said in zip(marks, tick_labels(marks), strict=True):
            parts.append(Markup(grid).format(percent(1.0 - self.y.place(value)), said))
        return Markup("").join(parts)

    def _on_picture(self, x, y) -> tuple[np.ndarray, np.ndarray]:
        """Return where points lie in the stretched picture."""
        return SIDE * self.x.place(x), SIDE * (1.0 - self.y.place(y))

    def _path(self, path: str, css: str, title: str) -> None:
        shape = Markup('<path class="{}" d="{}">{}</path>')
        self._shapes.append(shape.format(css, path, _title(title)))

    def _rectangle(self, sides, css: str, title: str) -> None:
        shape = Markup('<rect class="{}" x="{}" y="{}" width="{}" height="{}">{}</rect>')
        lengths = (_short(SIDE * float(side)) for side in sides)
        self._shapes.append(shape.format(css, *lengths, _title(title)))


def _title(text: str) -> Markup:
    return Markup("<title>{}</title>").format(text) if text else Markup("")


def tick_labels(values) -> list[str]:
    """Return what ticks say, with minus signs.

    >>> tick_labels([-0.5, 0.0, 0.5])
    ['−0.5', '0', '0.5']
    """
    return [f"{value:.10g}".replace("-", "−").replace("e−0", "e−") for value in values]


def thinned(x: np.ndarray, y: np.ndarray, bins: int = BINS) -> tuple[np.ndarray, np.ndarray]:
    """Return a curve by the lowest and the highest point of every bin, where it has many points."""
    if x.size <= 2 * bins:
        return x, y
    rows = []
    for part in np.array_split(np.arange(x.size), bins):
        value = y[part]
        if np.isfinite(value).any():
            rows += sorted((part[np.nanargmin(value)], part[np.nanargmax(value)]))
        else:
            rows += [part[0], part[-1]]
    return x[rows], y[rows]


def _polyline(h: np.ndarray, v: np.ndarray) -> str:
    path, pen = [], "M"
    far = 100 * SIDE  # beyond that renderers lose count
    for a, b in zip(h, v, strict=True):
        if math.isfinite(a) and math.isfinite(b):
            path.append(f"{pen}{_short(a)} {_short(min(max(b, -far), far))}")
            pen = "L"
        else:
            pen = "M"
    return "".join(path)


def _short(value: float) -> str:
    text = f"{value:.1f}".removesuffix(".0")
    return "0" if text == "-0" else text


def strip(label: str, shapes, css: str = "") -> Markup:
    """Return a strip of a row of a table with shapes, such as `dot`, `span` and `mark`."""
    inner = Markup("").join(shapes)
    text = Markup('<svg class="strip {}" role="img" aria-label="{}">{}</svg>')
    return text.format(css, label, inner)


def dot(at: float, css: str, title: str = "") -> Markup:
    """Return a dot at a place from 0 to 1."""
    text = Markup('<circle class="{}" cx="{}" cy="50%" r="5">{}</circle>')
    return text.format(css, percent(at), _title(title))


def span(low: float, high: float, css: str, title: str = "") -> Markup:
    """Return a band between two places from 0 to 1."""
    low, high = min(max(low, 0.0), 1.0), min(max(high, 0.0), 1.0)
    text = Markup('<rect class="{}" x="{}" width="{}" height="100%">{}</rect>')
    return text.format(css, percent(low), percent(high - low), _title(title))


def whisker(low: float, high: float, css: str, title: str = "") -> Markup:
    """Return a line between two places from 0 to 1."""
    low, high = min(max(low, 0.0), 1.0), min(max(high, 0.0), 1.0)
    text = Markup('<line class="{}" x1="{}" x2="{}" y1="50%" y2="50%">{}</line>')
    return text.format(css, percent(low), percent(high), _title(title))


def mark(at: float, css: str, title: str = "") -> Markup:
    """Return an upright line at a place from 0 to 1."""
    text = Markup('<line class="{0}" x1="{1}" x2="{1}" y1="0" y2="100%">{2}</line>')
    return text.format(css, percent(at), _title(title))


def scale_text(scale: Scale) -> Markup:
    """Return the ticks of a scale as a strip of text."""
    marks = scale.ticks()
    texts = (
        Markup('<text class="below" x="{}" y="12">{}</text>').format(percent(scale.place(v)), said)
        for v, said in zip(marks, tick_labels(marks), strict=True)
    )
    return Markup('<svg class="strip ticks" aria-hidden="true">{}</svg>').format(
        Markup("").join(texts)
    )
