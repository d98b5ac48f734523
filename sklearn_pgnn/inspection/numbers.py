"""Format numbers, units and formulas for readers, with an appropriate number of digits."""

import math
import re

from sklearn_pgnn.experiment_design.detectability import Detectable


def number(value: float, digits: int = 4) -> str:
    """Write a number with some significant digits, without an exponent up to a million.

    >>> number(0.0804999), number(float("nan")), number(12345678.0)
    ('0.0805', '-', '1.235e+07')
    >>> number(1200.0, 2), number(999999.0)
    ('1200', '1e+06')
    """
    if not math.isfinite(value):
        return "-"
    text = f"{value:.{digits}g}"
    return f"{float(text):.0f}" if "e+" in text and abs(float(text)) < 1e6 else text


def free_run_error(value: float) -> str:
    """Return the error of a free run in words."""
    return number(value, 3) if math.isfinite(value) else "diverges"


def measured(value: float, low: float, high: float, unit: str = "") -> str:
    """Write a value with its interval, with no more digits than the interval justifies.

    If the interval excludes zero, only zero is rounded to zero, and an end that is less than the
    sixth digit of the other: a quantity above zero ends there. A unit of 1 is omitted.
    """
    unit = "" if unit == "1" else unit
    if math.isfinite(low) != math.isfinite(high):
        return _half_open(value, low, high, unit)
    if not math.isfinite(low) or low == high:
        return f"{number(value)} {unit}".rstrip()
    places = _places(value, (high - low) / 2)
    low, high = (
        0.0 if abs(x) < 1e-6 * abs(other) else x for x, other in ((low, high), (high, low))
    )
    inside = low < 0 < high
    here, start, end = (
        _rounded(x, places if inside else _kept(x, places)) for x in (value, low, high)
    )
    return f"{here} ({start} to {end}) {unit}".rstrip()


def _half_open(value: float, low: float, high: float, unit: str) -> str:
    """Write a value whose interval has only one end."""
    end, words = (low, "at least") if math.isfinite(low) else (high, "at most")
    if math.isnan(low) or math.isnan(high) or end == value:
        return f"{number(value)} {unit}".rstrip()
    places = _places(value, abs(end - value))
    here, there = (_rounded(x, _kept(x, places)) for x in (value, end))
    return f"{here} ({words} {there}) {unit}".rstrip()


def sized(value: float, low: float, high: float, unit: str = "") -> str:
    """Write a value with no more digits than its interval justifies, without the interval."""
    interval = r" \((.* to |at least |at most )[^ ]*\)"
    return re.sub(interval, "", measured(value, low, high, unit))


def times(value: float) -> str:
    """Write an error in units of the noise."""
    if math.isnan(value):
        return "-"
    if math.isinf(value):
        return "diverges"
    places = max(0, 2 - math.floor(math.log10(max(value, 1.0))))
    return f"{value:.{places}f} ×"


def _places(value: float, half_width: float) -> int:
    """Return the decimals that show one or two digits of the half-width, six of the value."""
    places = -math.floor(math.log10(half_width / 3))
    if value:
        places = min(places, 5 - math.floor(math.log10(abs(value))))
    return places


def _kept(value: float, places: int) -> int:
    """Return decimals with which a value is not rounded to zero: then two of its digits."""
    if value and round(value, places) == 0:
        return 1 - math.floor(math.log10(abs(value)))
    return places


def _rounded(value: float, places: int) -> str:
    if value and not 1e-4 <= abs(value) < 1e6 and abs(round(value, places)) > 0:
        return f"{value:.{max(places + math.floor(math.log10(abs(value))), 0)}e}"
    return f"{round(value, places):.{max(places, 0)}f}"


def readable(formula: str) -> str:
    """Write an expression for readers: raised powers, dots for products, one sign for minus.

    >>> readable("-0.2005*F**2*v - 3*v"), readable("x**-0.5")
    ('−0.2005·F²·v − 3·v', 'x**-0.5')
    """
    signed = re.sub(r"^-|(?<= )-(?= )", "−", _raised(formula))
    return re.sub(r"(?<!\*)\*(?!\*)", "·", signed)


def typeset_unit(unit: str) -> str:
    """Write the powers of a unit as superscripts; a unit of 1 is omitted.

    >>> typeset_unit("kg m^2"), typeset_unit("N m s**-1"), typeset_unit("m^0.5")
    ('kg m²', 'N m s⁻¹', 'm^0.5')
    """
    return "" if unit.strip() == "1" else _raised(unit)


def _raised(text: str) -> str:
    """Write powers as superscripts."""
    raised = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
    power = r"(?:\^|\*\*)(-?\d+)(?![\d.])"
    return re.sub(power, lambda found: found[1].translate(raised), text)


def percent(part: float) -> str:
    """Return a share in percent; one just below 1 is not rounded to 100 %.

    >>> percent(0.704), percent(0.9934), percent(0.99996), percent(1.0)
    ('70 %', '99.3 %', '> 99.9 %', '100 %')
    """
    if not math.isfinite(part):
        return "-"
    if part >= 1.0 or part <= 0.0:
        return f"{100 * part:.0f} %"
    if part > 0.9995:
        return "> 99.9 %"
    return f"{100 * part:.{1 if part > 0.985 else 0}f} %"


def chance(probability: float | None) -> str:
    """Return a probability in percent; one that is nearly 0 or 1 is not rounded to it.

    >>> chance(0.213), chance(0.9999), chance(1.0), chance(2e-4)
    ('21 %', '> 99.9 %', '> 99.9 %', '< 0.1 %')
    >>> chance(math.nan), chance(None)
    ('not tested', 'not tested')
    """
    if probability is None or math.isnan(probability):
        return "not tested"
    if probability > 0.999:
        return "> 99.9 %"
    if probability < 0.001:
        return "< 0.1 %"
    return f"{100 * probability:.{1 if not 0.01 <= probability <= 0.985 else 0}f} %"


def share(gain) -> str:
    """Write the explained share of a gain with its interval.

    >>> from types import SimpleNamespace as Gain
    >>> share(Gain(explained_share=0.927, low=0.874, high=0.963))
    '93 % (87 to 96 %)'
    >>> share(Gain(explained_share=1.0, low=0.9999, high=1.0))
    '> 99.9 %'
    """
    low, high = 100 * gain.low, 100 * gain.high
    if low > 99.95:
        return "> 99.9 %"
    places = 1 if low > 98.5 else 0
    return f"{100 * gain.explained_share:.{places}f} % ({low:.{places}f} to {high:.{places}f} %)"


def fit_text(fit: float, decimals: int = 0) -> str:
    """Return the fit of a simulation [%] as text.

    >>> fit_text(98.4), fit_text(99.84, decimals=1), fit_text(-2e4)
    ('98 %', '99.8 %', 'below −1000 %')
    >>> fit_text(-math.inf), fit_text(math.nan)
    ('diverges', 'nothing to fit')
    """
    if math.isnan(fit):
        return "nothing to fit"
    if math.isinf(fit):
        return "diverges"
    return f"{fit:.{decimals}f} %" if fit > -1000 else "below −1000 %"


def least_size(row: Detectable, digits: int = 2) -> str:
    """Return the smallest size with its unit, and whether none smaller was tried."""
    size = f"{number(row.smallest, digits)} {typeset_unit(row.unit)}".rstrip()
    if abs(row.smallest) < abs(row.curve[0][0]):  # the less, the more it does
        size = f"up to {size}"
    return f"{size} (smallest tried)" if row.is_least_tried else size
